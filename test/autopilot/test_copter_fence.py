"""The fence that ArduPilot keeps by itself, read from ArduPilot's own software."""

from __future__ import annotations

import re
from pathlib import Path
from typing import List, Tuple

import pytest
from copter_rig import ORIGIN, CopterRig
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.errors import GoalRefused

pytestmark = pytest.mark.timeout(1800)  # flights last

INSIDE = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
OUTSIDE = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
CIRCLE_OUTSIDE = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
ITSELF = "the autopilot's fence"
SLOWLY = FlightLimits(speed_m_s=1.0, cruise_height_m=6.0, layer_m=1.0)
READ_WITHIN_S = 60.0  # ten seconds after the last answer, on a machine that may be busy

Items = List[Tuple[int, float, EarthPlace]]


def area(command: int, size: float, *places: tuple[float, float]) -> Items:
    return [(command, size, ORIGIN.to_earth(Location(*place, 0.0))) for place in places]


def field(south: float, north: float, command: int = INSIDE) -> Items:
    return area(command, 4.0, (south, -60), (north, -60), (north, 60), (south, 60))


FIELD = field(-30, 100)
POND = area(CIRCLE_OUTSIDE, 10.0, (40, 20))
BARN = field(50, 70, OUTSIDE)


def refusal(rig: CopterRig, *goal: float) -> str:
    try:
        rig.engine.set_goal(*goal)
    except GoalRefused as error:
        return str(error)
    return ""


def test_what_is_beyond_it_is_refused_by_name_before_the_first_order_and_when_it_changes(
    program: tuple[Path, Path], tmp_path: Path
) -> None:
    kept = {"FENCE_TYPE": 7.0, "FENCE_ALT_MAX": 30.0, "FENCE_RADIUS": 120.0}
    with CopterRig(program, tmp_path, 0, 1.0, parameters=kept, ready=False, limits=SLOWLY) as rig:
        rig.pilot.upload_fence([*FIELD, *POND])
        rig.engine.close()
        rig.start_engine()  # which has seen nothing of that
        rig.pilot.make_ready()
        rig.pilot.until("ready to fly", rig.engine.can_fly)
        print(rig.engine.fences().names)
        for goal, words in (
            ((105.0, 0.0, 10.0), f"outside {ITSELF}, area 1"),
            ((40.0, 15.0, 10.0), f"inside {ITSELF}, area 2"),
            ((0.0, 20.0, 31.0), f"above {ITSELF}, around home"),
        ):
            assert re.search(words, refusal(rig, *goal)), goal
        rig.pilot.set("FENCE_RADIUS", 80.0)
        rig.pilot.until(
            "smaller", lambda: "around home" in refusal(rig, 90.0, 0.0, 10.0), READ_WITHIN_S
        )
        rig.pilot.set("FENCE_RADIUS", 200.0)
        there = Location(90.0, 0.0, 10.0).to_vector()
        rig.pilot.until("wider", lambda: not rig.engine.fences().why_not(there), READ_WITHIN_S)
        rig.set_out(90.0, -20.0, 7.0)
        rig.pilot.upload_fence([*FIELD, *BARN])  # in its way, from fence to fence
        rig.pilot.until("ended", lambda: not rig.engine.is_flying(), READ_WITHIN_S)
        print(rig.engine.why_ended(), rig.engine.get_location().in_words())
        rig.pilot.upload_fence(field(-30, 45))
        rig.pilot.until("smaller", lambda: "area 1" in refusal(rig, 60.0, 0.0, 10.0), READ_WITHIN_S)
