"""Without a gateway the node flies a copter home, and the gateway comes back on the way.

The last two rows of the table "If the mesh is lost" in docs/flying.md.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from copter_fleet import Fleet

from drone_mesh.drone.location import Location

pytestmark = pytest.mark.timeout(900)  # flights last

NODE = 1
HOME, GOAL, ELSEWHERE = Location(0, 10, 0), Location(70, 10, 18), Location(50, 30, 18)
RETURNS = ("--lost-mesh", "return", "--lost-mesh-after", "10")  # before a repair would fly


@pytest.mark.parametrize("autopilot_flies", [False, True])
def test_a_gateway_that_is_back_orders_a_returning_copter_but_not_while_the_autopilot_flies_it(
    program: tuple[Path, Path], tmp_path: Path, autopilot_flies: bool
) -> None:
    with Fleet(program, tmp_path, {NODE: HOME}, 1.0, 1.0, flight_options=RETURNS) as fleet:
        pilot = fleet.pilots[NODE]
        fleet.until("connected", lambda: fleet.reachable() == {NODE})
        fleet.fly_layout({NODE: GOAL})
        fleet.kill_gateway()
        fleet.until("on its way home", lambda: not fleet.is_at(NODE, GOAL, 5.0))
        if autopilot_flies:
            pilot.set("SIM_BATT_VOLTAGE", 10.0)
            pilot.until("in RTL", lambda: pilot.mode == "RTL")
        fleet.start_gateway()
        fleet.until("connected again", lambda: fleet.reachable() == {NODE})
        if autopilot_flies:
            fleet.order(NODE, ELSEWHERE)
            outcome = fleet.outcome(NODE)
            assert outcome == "refused: drone 1 cannot fly: the autopilot reports a failsafe"
            fleet.until("at home", lambda: fleet.is_at(NODE, HOME))
            assert pilot.mode == "RTL"
        else:
            assert pilot.mode == "GUIDED"
            assert not fleet.is_at(NODE, HOME, 20.0)
            hovers_at = fleet.places[NODE]
            fleet.watch_for(10.0)
            assert fleet.is_at(NODE, hovers_at)
            fleet.order(NODE, ELSEWHERE)
            outcome = fleet.outcome(NODE)
            assert outcome.startswith("arrived")
        print(f"a gateway again: {outcome}, in {pilot.mode}", flush=True)
