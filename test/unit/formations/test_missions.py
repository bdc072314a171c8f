"""Missions, and the file that holds them."""

from __future__ import annotations

import pytest

from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.formations.missions import Mission, read_missions


def read(tmp_path, text):
    path = tmp_path / "missions.yaml"
    path.write_text(text, encoding="utf-8")
    return read_missions(path)


def test_a_mission_is_read_for_each_of_its_drones(tmp_path):
    missions = read(
        tmp_path,
        "missions:\n- {drones: [1, 4], waypoints: [[0, 1], [2.5, 3]], height: 2, speed: 1}\n"
        "- drones: [2]\n  waypoints: [[7, 8]]\n  loop: false\n",
    )
    assert missions[1] == missions[4] == Mission([(0.0, 1.0, 2.0), (2.5, 3.0, 2.0)], 1.0, True)
    assert missions[2] == Mission([(7.0, 8.0, 3.0)], 0.5, False)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("drones: [1]", "expected 'missions:' with a list"),
        ("missions: 3", "expected 'missions:' with a list"),
        ("missions:\n- 5", "line 2: expected a mission with drones, waypoints"),
        ("missions:\n- {drones: [1], waypoint: [[0, 0]]}", "line 2: expected a mission"),
        ("missions:\n- drones: [1]\n  waypoints: [[0, a]]", "line 3: invalid waypoints"),
        ("missions:\n- drones: [254]\n  waypoints: [[0, 0]]", "line 2: invalid drones"),
        ("missions:\n- {drones: [true], waypoints: [[0, 0]]}", "invalid drones"),
        ("missions:\n- {drones: [1], waypoints: [[0, 0]], loop: 1}", "expected true or false"),
        ("missions:\n- {drones: [1], waypoints: [[0, 0]], speed: 0}", "speed 0 m/s: must be"),
        ("missions:\n- {drones: [1], waypoints: [[0, 9000]]}", "latitude 9000 m is outside"),
        ("missions:\n- {drones: [1], waypoints: [[0, .nan]]}", "not a finite number"),
        ("missions:\n- &a {drones: [1], waypoints: [[0, 0]]}\n- {drones: [1], waypoints: [[1, 1]]}",
         "line 3: drone 1 has a mission already"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_named_with_line_and_reason(tmp_path, text, words):
    with pytest.raises(ConfigurationError, match=words):
        read(tmp_path, text)


def test_a_mission_needs_waypoints_and_few_enough():
    for waypoints in ([], [(0.0, 0.0, 1.0)] * 1001):
        with pytest.raises(GoalRefused, match=r"use 1\.\.1000"):
            Mission(waypoints, 1.0, True).pilot()
