"""Who wins on the way home of a lost mesh (docs/flying.md, "If the mesh is lost")."""

from __future__ import annotations

from typing import Callable

import pytest
from mavlink_rig import ARDUPILOT, Rig, in_flight
from mavlink_vehicle.modes import Mode

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.pilot_status import UNDER_WAY
from drone_mesh.errors import GoalRefused

HOME = Location(0.0, 0.0, 0.0)
BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)


def flies_home(rig: Rig) -> bool:
    try:
        rig.pilot.set_goal(HOME, True, rig.now_s, for_repair=True)
    except GoalRefused:
        return False
    return True


def on_its_way_home(autopilot: Autopilot) -> Rig:
    rig = in_flight(autopilot)
    rig.run_until("it is far away", lambda: rig.place.latitude > 40.0)
    assert flies_home(rig)
    rig.run_until("it is on its way back", lambda: rig.place.latitude < 35.0)
    return rig


def pilot_holds(rig: Rig) -> None:
    rig.vehicle.choose_mode(Mode.HOLD)


def battery_at_30(rig: Rig) -> None:
    rig.vehicle.body.battery_percent = 28.9


def battery_at_15(rig: Rig) -> None:
    rig.vehicle.body.battery_percent = 14.9


def fence(rig: Rig) -> None:
    rig.vehicle.faults.fence_breached = True


def no_position(rig: Rig) -> None:
    rig.vehicle.faults.estimate_good = False


def node_sleeps(rig: Rig) -> None:
    rig.down.broken = True
    rig.run(8.0)
    rig.down.broken = False


@BOTH
def test_the_node_wins_where_nothing_else_happens(autopilot: Autopilot) -> None:
    rig = on_its_way_home(autopilot)
    rig.run_until("it has landed", lambda: rig.place.height == 0.0)
    rig.run(10.0)
    assert rig.place.distance_m(HOME) < 1.5
    assert not rig.vehicle.body.armed
    assert not rig.vehicle.in_failsafe
    assert rig.status().why_not_fly == ""  # its gateway may order it again


@BOTH
@pytest.mark.parametrize(
    ("happens", "mode"),
    [
        (pilot_holds, Mode.HOLD),
        (battery_at_30, Mode.FOLLOW),  # nobody: below --min-battery, above the autopilot's level
        (battery_at_15, Mode.LAND),
        (fence, Mode.RETURN),
        (no_position, Mode.LAND),
        (node_sleeps, Mode.LAND),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_the_pilot_and_the_autopilot_win_over_the_way_home(
    autopilot: Autopilot, happens: Callable[[Rig], None], mode: Mode
) -> None:
    rig = on_its_way_home(autopilot)
    happens(rig)
    rig.run(3.0)
    before = len(rig.commands())
    for _ in range(20):
        rig.run(0.5)
        assert not flies_home(rig)
    assert rig.vehicle.mode is mode
    assert rig.status().phase not in UNDER_WAY
    assert len(rig.commands()) == before
    if mode is Mode.FOLLOW:
        assert rig.place.height > 5.0  # it hovers until the autopilot acts
        battery_at_15(rig)
        rig.run(1.0)
        assert rig.vehicle.mode is Mode.LAND


@pytest.mark.parametrize(("options", "mode"), [(16.0, Mode.RETURN), (24.0, Mode.LAND)])
def test_a_low_battery_ends_a_landing_unless_the_autopilot_is_told_to_land_on(
    options: float, mode: Mode
) -> None:
    rig = on_its_way_home(ARDUPILOT)
    rig.vehicle.parameters.update(BATT_FS_LOW_ACT=2.0, FS_OPTIONS=options)
    rig.run_until("it lands", lambda: rig.vehicle.mode is Mode.LAND)
    before = len(rig.commands())
    battery_at_15(rig)
    rig.run(2.0)
    assert rig.vehicle.mode is mode
    assert rig.status().ended == "the autopilot reports a failsafe"
    rig.run_until("it is down", lambda: not rig.vehicle.body.armed)
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run(10.0)
    assert len(rig.commands()) == before
    assert rig.status().why_not_fly == "the autopilot reports a failsafe"  # until it starts anew
