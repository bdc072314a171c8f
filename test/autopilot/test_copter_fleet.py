"""Six copters of ArduPilot under gateway and routers, each a program of its own, on one air.

A layout, a mission as motion, a copter that its pilot takes, a relay whose node is killed while its
copter hovers, and its return: nobody comes nearer than 5 m to any other.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Iterator

import pytest
from copter_fleet import Fleet
from copter_rig import ORIGIN

from drone_mesh.drone.location import Location

pytestmark = pytest.mark.timeout(1800)  # flights last

RUNS = int(os.environ.get("AUTOPILOT_RUNS", "1"))
PACE = float(os.environ.get("AUTOPILOT_PACE", "1"))  # below 1: slow motion, on a busy machine
PICTURE = os.environ.get("AUTOPILOT_PICTURE")  # file for one of the console
NEAREST_M = 5.0
HOMES = {  # on the ground
    1: Location(0.0, 40.0, 0.0),
    2: Location(30.0, 40.0, 0.0),
    3: Location(15.0, 60.0, 0.0),
    4: Location(-40.0, 20.0, 0.0),
    5: Location(0.0, 75.0, 0.0),
    6: Location(-20.0, 60.0, 0.0),
}
LAYOUT = {
    1: Location(0.0, 60.0, 20.0),
    2: Location(30.0, 60.0, 20.0),
    3: Location(10.0, 125.0, 20.0),
    4: Location(-40.0, 20.0, 20.0),
    5: Location(15.0, 190.0, 20.0),
    6: Location(-20.0, 195.0, 20.0),
}
RELAY, TAKEN, ON_MISSION = 3, 2, 4


@pytest.fixture
def fleet(program: tuple[Path, Path], tmp_path: Path) -> Iterator[Fleet]:
    with Fleet(program, tmp_path, HOMES, PACE, hovers_on=RELAY) as fleet:
        yield fleet


@pytest.mark.parametrize("run", range(RUNS))
def test_six_copters_keep_the_mesh_together_and_apart_from_each_other(
    fleet: Fleet, run: int
) -> None:
    started_s = fleet.now_s()

    def say(what: str) -> None:
        print(f"{fleet.now_s() - started_s:6.1f} s  {what}; nearest {fleet.nearest}", flush=True)

    everybody = set(HOMES)
    fleet.until("all are connected", lambda: fleet.reachable() >= everybody)
    say("all six routers are connected")

    fleet.fly_layout(LAYOUT)
    fleet.until("all are connected", lambda: fleet.reachable() >= everybody)
    say("the layout is flown, everybody is connected")
    fleet.until("the gateway knows the places", lambda: fleet.gateway_error_m() < 3.0)
    say(f"gateway and ground stations agree on all places within {fleet.gateway_error_m():.1f} m")

    if PICTURE:
        with fleet.page() as page:
            fleet.watch_for(8.0)
            page.screenshot(path=PICTURE)
    mission = [Location(-40.0, 60.0, 20.0), Location(-60.0, 30.0, 20.0), Location(-40.0, 5.0, 20.0)]
    pilot = fleet.pilots[ON_MISSION]
    pilot.upload([ORIGIN.to_earth(place) for place in mission])
    pilot.choose("AUTO")
    fleet.pilots[TAKEN].choose("BRAKE")  # whose hovering needs no stick
    fleet.until("it stands", lambda: fleet.is_at_rest(ON_MISSION))
    where = fleet.places[TAKEN]
    fleet.order(TAKEN, Location(60.0, 30.0, 20.0))
    words = fleet.outcome(TAKEN)
    say(f"an order for {TAKEN}: {words}")
    assert words.startswith("refused: ")
    assert "in BRAKE, flown by its pilot" in words
    fleet.kill_router(RELAY)
    say(f"copter {ON_MISSION} flies its mission, {TAKEN} is its pilot's, node {RELAY} is killed")

    left = everybody - {RELAY}
    fleet.until("the relay is missed", lambda: not fleet.reachable() >= left, 60.0)
    fleet.until("the group repairs", lambda: fleet.reachable() >= left, 300.0)
    say("the group has repaired the mesh")
    assert fleet.is_at(RELAY, LAYOUT[RELAY], 4.0)  # it hovers on

    fleet.until("everybody has come to rest", lambda: fleet.is_at_rest(ON_MISSION))
    before = dict(fleet.places)
    fleet.start_router(RELAY)
    fleet.until("the relay is back", lambda: fleet.reachable() >= everybody)
    fleet.watch_for(40.0)
    say("the relay's node is back")
    for node in everybody - {ON_MISSION}:
        assert fleet.is_at(node, before[node], 3.0), f"{node} moved: a duel for the place"
    assert fleet.pilots[TAKEN].mode == "BRAKE"
    assert fleet.is_at(TAKEN, where, 5.0)
    assert fleet.pilots[ON_MISSION].mode in ("AUTO", "LOITER")
    assert fleet.nearest[0] >= NEAREST_M
