"""A flight with a MAVLink autopilot: the profile, the limits, hovering and landing."""

from __future__ import annotations

import pytest
from mavlink_rig import ARDUPILOT, Rig, lift
from mavlink_vehicle.modes import Mode
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.errors import GoalRefused

BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)


@BOTH
def test_with_every_permission_it_takes_off_flies_up_across_and_down_and_hovers(
    autopilot: Autopilot,
) -> None:
    rig = Rig(autopilot).ready()
    assert rig.status().why_not_fly == ""
    rig.goal(30.0, 20.0, 5.0)
    rig.reach(Phase.HOLDING)
    rig.run(5.0)
    assert rig.place.distance_m(Location(30.0, 20.0, 5.0)) < 0.2
    assert rig.vehicle.mode is Mode.FOLLOW
    assert max(rig.heights) == pytest.approx(12.0, abs=0.2)  # layer 1: 10 m + 2 m


@BOTH
def test_across_it_flies_only_at_its_own_height(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.goal(40.0, 0.0, 5.0)
    while rig.status().phase is not Phase.HOLDING:
        rig.step()
        if 2.0 < rig.place.latitude < 38.0:
            assert rig.place.height == pytest.approx(12.0, abs=0.5)


def test_drones_with_different_ids_cross_in_different_layers() -> None:
    limits = FlightLimits(max_height_m=20.0, cruise_height_m=10.0, layer_m=2.0)
    heights = [limits.layer_height_m(node_id) for node_id in range(7)]
    assert heights == [10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 10.0]


@BOTH
def test_an_ordered_landing_ends_on_the_ground_disarmed(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.goal(10.0, 0.0, 0.0, lands=True)
    rig.run_until("it has landed", lambda: rig.status().phase is Phase.IDLE)
    assert rig.place.distance_m(Location(10.0, 0.0, 0.0)) < 1.0
    assert not rig.vehicle.body.armed
    assert rig.commands()[-1] == mavlink.MAV_CMD_NAV_LAND


@BOTH
def test_from_where_it_was_ordered_to_land_it_can_take_off_again(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.goal(10.0, 0.0, 0.0, lands=True)
    rig.run_until("it has landed", lambda: rig.status().phase is Phase.IDLE)
    rig.run(2.0)
    assert rig.status().why_not_fly == ""
    rig.goal(0.0, 0.0, 6.0)
    rig.reach(Phase.HOLDING)
    assert rig.place.height == pytest.approx(6.0, abs=1.0)


@BOTH
def test_a_new_goal_replaces_the_old_one_in_flight(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.goal(60.0, 0.0, 5.0)
    rig.run_until("it is on its way", lambda: rig.place.latitude > 10.0)
    rig.goal(0.0, 20.0, 5.0)
    rig.reach(Phase.HOLDING)
    rig.run(3.0)
    assert rig.place.distance_m(Location(0.0, 20.0, 5.0)) < 0.2
    assert rig.commands().count(mavlink.MAV_CMD_COMPONENT_ARM_DISARM) == 1


def test_the_same_goal_again_changes_nothing() -> None:
    rig = Rig().ready()
    rig.goal(30.0, 0.0, 5.0)
    rig.run_until("it is on its way", lambda: rig.place.latitude > 10.0)
    before = len(rig.commands())
    rig.goal(30.0, 0.0, 5.0)
    rig.run(2.0)
    assert len(rig.commands()) == before
    assert rig.place.latitude > 12.0


def test_it_flies_at_the_speed_that_was_set() -> None:
    rig = Rig(limits=FlightLimits(speed_m_s=3.0)).ready()
    rig.goal(100.0, 0.0, 12.0)
    rig.run_until("it is on its way", lambda: rig.place.latitude > 20.0)
    start_m, start_s = rig.place.latitude, rig.now_s
    rig.run_until("it is further", lambda: rig.place.latitude > 80.0)
    speed = (rig.place.latitude - start_m) / (rig.now_s - start_s)
    assert speed == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ((0.0, 0.0, 51.0), "51 m above home is more than --max-height 50"),
        ((400.0, 400.0, 10.0), "566 m from home is more than --max-distance 500"),
        ((float("nan"), 0.0, 10.0), "latitude nan is not a finite number"),
        ((0.0, 0.0, -1.0), "height -1 m is outside"),
    ],
)
def test_a_goal_outside_the_limits_is_refused(goal, why: str) -> None:
    rig = Rig().ready()
    with pytest.raises(GoalRefused, match=why):
        rig.goal(*goal)
    rig.run(5.0)
    assert rig.commands() == []


def test_a_drone_that_its_pilot_flew_out_of_the_limits_is_not_led_further() -> None:
    rig = Rig(PX4, limits=FlightLimits(max_distance_m=50.0))
    lift(rig.vehicle, 10.0)
    rig.vehicle.body.place = Location(80.0, 0.0, 10.0)
    rig.ready()
    assert rig.targets()
    assert all(target.latitude == pytest.approx(50.0, abs=0.1) for target in rig.targets())


POND = Zone.circle("pond", (0.0, 20.0), 5.0, inside=False)
SHED = Zone("shed", (((-50, 15), (50, 15), (50, 25), (-50, 25)),), highest_m=15.0)
FAR = Zone("far", (((90, 0), (99, 0), (99, 9)),))
WIRE = Zone("wire", (((30, -9), (31, -9), (31, 9), (30, 9)),), lowest_m=5.0)
ROOF = Zone("roof", (((-9, -9), (9, -9), (9, 9), (-9, 9)),), lowest_m=2.0)
LOW = Zone("low", (((-60, -60), (60, -60), (60, 60), (-60, 60)),), highest_m=6.0)


@pytest.mark.parametrize(
    ("fence", "goal", "words", "highest_m"),
    [
        (Fence.of([LOW], []), (70.0, 0.0, 5.0), "outside fence low", 0.0),
        (Fence.of([LOW], []), (40.0, 0.0, 7.0), "above fence low", 0.0),
        (Fence.of([], [POND]), (40.0, 0.0, 5.0), "", 12.0),
        (Fence.of([], [SHED]), (40.0, 0.0, 5.0), "", 15.5),
        (Fence.of([LOW], [POND]), (40.0, 0.0, 5.0), "", 5.5),
        (Fence.of([], [WIRE]), (40.0, 0.0, 2.0), "", 12.0),  # in its layer: it is not in the way
        (Fence.of([], [ROOF]), (40.0, 0.0, 0.5), "no path", 0.0),  # it takes off to 3 m
        (Fence.of([LOW, FAR], []), (1.0, 98.0, 5.0), "no path", 0.0),
    ],
)  # fmt: skip
def test_it_flies_round_over_or_under_what_the_fence_forbids_or_refuses(
    fence: Fence, goal: tuple[float, float, float], words: str, highest_m: float
) -> None:
    rig = Rig(fence=fence).ready()
    if words:
        with pytest.raises(GoalRefused, match=words):
            rig.goal(*goal)
        return
    rig.goal(*goal)
    while rig.status().phase is not Phase.HOLDING:
        rig.step()
        assert not fence.why_not(rig.place._replace(height=max(0.0, rig.place.height)).to_vector())
    assert rig.place.distance_m(Location(*goal)) < 1.0
    assert max(rig.heights) == pytest.approx(highest_m, abs=0.3)


@pytest.mark.parametrize(
    ("height_m", "top_m", "lowest_m"),
    [(30.0, 50.0, 30.0), (30.0, 20.0, 12.0)],  # it goes down only if it is above the fence
)
def test_a_drone_that_is_outside_goes_down_there_only_if_it_has_to(
    height_m: float, top_m: float, lowest_m: float
) -> None:
    yard = Zone("yard", (((-60, -60), (60, -60), (60, 60), (-60, 60)),), highest_m=top_m)
    rig = Rig(fence=Fence.of([yard], []))
    lift(rig.vehicle, height_m)
    rig.vehicle.body.place = Location(70.0, 0.0, height_m)
    rig.ready()
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run(2.0)
    rig.heights.clear()
    rig.goal(40.0, 0.0, 5.0)
    rig.run_until("it is inside", lambda: rig.place.latitude < 60.0)
    assert min(rig.heights) == pytest.approx(lowest_m, abs=0.3)
