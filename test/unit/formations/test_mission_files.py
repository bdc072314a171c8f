"""Missions of other programs: what is flown, what is told, and what is refused."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.formations.mission_files import read_mission
from drone_mesh.formations.missions import Mission, read_missions

ORIGIN = Origin(52.0907, 5.1214, 3.0)
EAST_DEG, NORTH_DEG = 1.4602e-4, 8.9876e-5  # about 10 m there
HOME = f"{ORIGIN.latitude_deg} {ORIGIN.longitude_deg} 3"
NAN = math.nan


def at(x: float, y: float, z: float) -> list[float]:
    """Latitude, longitude and height of a place in units of 10 m."""
    return [ORIGIN.latitude_deg + y * NORTH_DEG, ORIGIN.longitude_deg + x * EAST_DEG, z]


Row = Any  # command, frame, values 1 to 4, place


def waypoints(*rows: Row, home: str = HOME) -> str:
    lines = [f"0 1 0 16 0 0 0 0 {home} 1"]
    for number, (command, frame, first, place) in enumerate(rows, start=1):
        values = " ".join(f"{value:.9f}" for value in (*first, *place))
        lines.append(f"{number} 0 {frame} {command} {values} 1")
    return "QGC WPL 110\n" + "\n".join(lines) + "\n"


def read(text: str, name: str = "a.waypoints", origin: Origin | None = ORIGIN) -> Any:
    drawn = read_mission(text, name, origin)
    return [tuple(round(m) for m in place) for place in drawn.waypoints], drawn


NONE = [0, 0, 0, 0]
UP = (22, 3, NONE, [0, 0, 15])
A, B = (16, 3, NONE, at(1, 0, 20)), (16, 3, NONE, at(1, 2, 20))
HEIGHTS = "heights above home are taken as above the origin"


@pytest.mark.parametrize(
    ("rows", "flown", "told"),
    [
        ([UP, A, B], [(10, 0, 20), (10, 20, 20)], [HEIGHTS]),
        # above sea level, less the origin's 3 m
        ([(16, 0, NONE, at(1, 0, 23))], [(10, 0, 20)], ["taken less the 3 m of the origin"]),
        # no height: that of the take-off; no place: that of the waypoint before
        ([UP, (16, 3, NONE, at(1, 0, 0))], [(10, 0, 15)], [HEIGHTS]),
        ([A, (16, 6, NONE, [0, 0, 9])], [(10, 0, 20), (10, 0, 9)], [HEIGHTS]),
        ([A, (16, 3, NONE, [NAN, NAN, NAN])], [(10, 0, 20)] * 2, [HEIGHTS]),
        # landings, and a take-off in between
        ([A, (21, 10, NONE, [0, 0, 0])], [(10, 0, 20), (10, 0, 20), (10, 0, 0)], [HEIGHTS]),
        (
            [A, (21, 3, NONE, at(2, 0, 0)), UP, B],
            [(10, 0, 20), (20, 0, 20), (20, 0, 0), (20, 0, 15), (10, 20, 20)],
            [HEIGHTS],
        ),
        (
            [A, (20, 2, NONE, [0, 0, 0])],
            [(10, 0, 20), (0, 0, 20), (0, 0, 0)],
            [HEIGHTS, "returns to its planned home, x 0, y 0 m: line 4"],
        ),
        # known, but not done as an autopilot does it
        ([(16, 3, [5, 0, 0, 0], at(1, 0, 20))], [(10, 0, 20)], ["passed without a stop: line 3"]),
        ([(82, 3, NONE, at(1, 0, 20))], [(10, 0, 20)], ["flown in straight lines: line 3"]),
        ([A, (178, 2, [1, 4, 0, 0], [0, 0, 0])], [(10, 0, 20)], ["not changed at: line 4"]),
        ([A, (177, 2, [1, -1, 0, 0], [0, 0, 0])], [(10, 0, 20)], ["not done: jump (177): line 4"]),
        (
            [A, *[(206, 2, NONE, [0, 0, 0])] * 5],
            [(10, 0, 20)],
            ["(206): line 4, line 5, line 6 and 2"],
        ),
        ([A, (42000, 2, NONE, [0, 0, 0])], [(10, 0, 20)], ["not done: command (42000): line 4"]),
    ],
)
def test_items_are_flown_or_told(rows, flown, told):
    places, drawn = read(waypoints(*rows))
    assert places == flown
    words = drawn.in_words()
    assert all(note in words for note in told), words
    assert (HEIGHTS in words) == any(row[1] in (3, 6) for row in rows)


def test_a_speed_before_the_first_waypoint_is_that_of_the_mission():
    _, drawn = read(waypoints((178, 2, [1, 4.5, 0, 0], [0, 0, 0]), A))
    assert drawn.speed_m_s == 4.5
    assert Mission.drawn(drawn, None, None, False).speed_m_s == 4.5
    assert Mission.drawn(drawn, 2.0, None, False).speed_m_s == 2.0


def test_a_height_of_the_flight_does_not_lift_its_landing():
    _, drawn = read(waypoints(A, (21, 3, NONE, [0, 0, 0])))
    assert [z for *_, z in Mission.drawn(drawn, None, 7.0, False).waypoints] == [7.0, 7.0, 0.0]


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (
            [A, (16, 10, NONE, at(1, 0, 20))],
            "line 4: its height is above the terrain, which is not",
        ),
        ([(22, 11, NONE, [0, 0, 9])], "line 3: its height is above the terrain"),
        ([(16, 1, NONE, [5, 5, -2])], "line 3: its frame is 1: expected 0 or 3"),
        ([(16, 3, NONE, [0, 0, 20])], "line 3: has no place, and no waypoint is before it"),
        ([(16, 3, NONE, at(1, 0, 0))], "line 3: has no height, and no item before it has one"),
        ([(16, 3, NONE, [NAN, 5.1, 20])], "line 3: 5.1, nan is not a longitude and a latitude"),
        ([(16, 3, NONE, at(600, 0, 20))], "in metres from the origin: longitude"),
        ([(16, 0, NONE, at(1, 0, 2))], "height -1 m is outside 0..500 m"),
        ([UP], "a.waypoints: 0 waypoints: a mission has 1 to 1000"),
        ([A] * 1001, "a.waypoints: 1001 waypoints: a mission has 1 to 1000"),
        ([A, *[(21, 3, NONE, [0, 0, 0])] * 500], "a.waypoints: 1001 waypoints"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(rows, why):
    with pytest.raises(ConfigurationError, match=why) as caught:
        read(waypoints(*rows))
    assert str(caught.value).startswith("a.waypoints: ")
    assert "\n" not in str(caught.value)


def test_a_plan_flies_at_its_speed_and_returns_only_to_a_home_that_it_has():
    items = [
        {"type": "SimpleItem", "command": command, "frame": frame, "params": [*NONE, *place]}
        for command, frame, place in ((16, 3, at(1, 0, 20)), (20, 2, [0, 0, None]))
    ]
    mission = {"items": [*items, {"type": "ComplexItem", "complexItemType": "StructureScan"}]}
    for home, flown in ([0, 0, 0], 1), (at(0, 0, 3), 3):
        plan = {
            "fileType": "Plan",
            "mission": {**mission, "hoverSpeed": 5, "plannedHomePosition": home},
        }
        places, drawn = read(json.dumps(plan), "Survey.PLAN")
        assert len(places) == flown
        assert ("not done: return to launch (20): item 2" in drawn.notes) == (flown == 1)
        assert drawn.notes[-1] == "not flown: 'StructureScan' after item 2"
        assert drawn.speed_m_s == 5.0


def line(height: str) -> str:
    places = " ".join(f"{lon},{lat}{height}" for lat, lon, _ in (at(1, 0, 0), at(1, 2, 0)))
    mode = "<altitudeMode>relativeToGround</altitudeMode>"
    return (
        f"<kml><Placemark><LineString>{mode}<coordinates>{places}</coordinates></LineString>"
        "</Placemark></kml>"
    )


def test_a_line_of_kml_is_a_mission_and_needs_a_height():
    places, _ = read(line(",12"), "a.kml")
    assert places == [(10, 0, 12), (10, 20, 12)]
    _, flat = read(line(""), "a.kml")
    with pytest.raises(GoalRefused, match="its waypoints have no height"):
        Mission.drawn(flat, 1.0, None, False)
    assert [z for *_, z in Mission.drawn(flat, 1.0, 8.0, False).waypoints] == [8.0, 8.0]
    two = line("").replace("</Placemark>", "</Placemark>" + line("")[5:-6])
    for text, name, why in (
        (two, "a.kml", "a.kml: has 2 lines: keep the one to fly"),
        ("x", "a.txt", "a.txt: expected a .plan, .waypoints, .kml or .geojson file"),
        ("x", "a.kmz", "a.kmz: a compressed file"),
        (" " * 1_500_001, "a.plan", "a.plan: longer than 1500000 characters"),
    ):
        with pytest.raises(ConfigurationError, match=why):
            read(text, name)
    with pytest.raises(ConfigurationError, match=r"a.plan: its places are in degrees: that needs"):
        read("{}", "a.plan", None)


def test_a_file_of_missions_names_the_drone_of_a_drawn_one(tmp_path, caplog):
    (tmp_path / "a.waypoints").write_text(waypoints(UP, A, B))
    path = tmp_path / "missions.yaml"
    path.write_text("missions:\n- {drones: [3, 4], file: a.waypoints, speed: 2}\n")
    mission = read_missions(path, ORIGIN)[4]
    assert (len(mission.waypoints), mission.speed_m_s, mission.loop) == (2, 2, False)
    assert f"a.waypoints: 2 waypoints; {HEIGHTS}" in caplog.text
    path.write_text("missions:\n- {drones: [3], file: gone.plan}\n")
    with pytest.raises(ConfigurationError, match=r"gone\.plan: No such file"):
        read_missions(path, ORIGIN)
    with pytest.raises(ConfigurationError, match=r"says not which drone flies it: name both in a"):
        read_missions(tmp_path / "a.waypoints", ORIGIN)


def test_a_file_with_thousands_of_unknown_commands_is_told_of_in_one_short_line():
    _flown, drawn = read(waypoints(A, *((5000 + n, 3, NONE, [0, 0, 0]) for n in range(3000))))
    assert len(drawn.in_words()) < 2000
    assert drawn.notes[-1] == "and 2981 more such notes"
