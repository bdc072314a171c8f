"""The pilot has priority: what ends a flight, and what this program may not do."""

from __future__ import annotations

import re
from typing import Callable

import pytest
from mavlink_bench import ALL, ARDUPILOT, NONE, TARGET, Bench
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.interfaces import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.drone.mavlink_vehicle.modes import Mode
from drone_mesh.errors import GoalRefused

BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)


def _in_the_air(autopilot: Autopilot, permissions: Permissions = ALL) -> Bench:
    bench = Bench(autopilot, permissions)
    bench.vehicle.lift(8.0)
    return bench.ready()


def _on_its_way(autopilot: Autopilot) -> Bench:
    bench = _in_the_air(autopilot)
    bench.goal(100.0, 0.0, 8.0)
    bench.run_until("it is on its way", lambda: bench.place.latitude > 20.0)
    return bench


# What it may not do --------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize(
    ("missing", "why"),
    [
        ("may_arm", "not armed: the pilot has to arm, or --may-arm"),
        ("may_take_off", "on the ground: the pilot has to take off, or --may-take-off"),
        ("may_change_mode", "or --may-change-mode"),
    ],
)
def test_without_a_permission_it_refuses_and_says_what_is_missing(
    autopilot: Autopilot, missing: str, why: str
) -> None:
    granted = {"may_arm": True, "may_take_off": True, "may_change_mode": True, missing: False}
    bench = Bench(autopilot, Permissions(**granted))
    bench.vehicle.choose_mode(Mode.HOLD)
    bench.ready()
    assert why in bench.status().why_not_fly
    with pytest.raises(GoalRefused, match=why):
        bench.goal(10.0, 0.0, 5.0)
    bench.run(10.0)
    assert bench.commands() == []
    assert not bench.vehicle.body.armed
    assert bench.place.height == 0.0


@BOTH
def test_it_never_takes_control_from_a_pilot_who_flies_by_hand(autopilot: Autopilot) -> None:
    bench = Bench(autopilot)
    bench.vehicle.lift(8.0)
    bench.vehicle.choose_mode(Mode.PILOT)
    bench.ready()
    assert "flown by its pilot" in bench.status().why_not_fly
    with pytest.raises(GoalRefused, match="flown by its pilot"):
        bench.goal(10.0, 0.0, 8.0)
    assert bench.commands() == []


@BOTH
def test_without_permissions_it_flies_when_the_pilot_hands_it_a_hovering_drone(
    autopilot: Autopilot,
) -> None:
    bench = _in_the_air(autopilot, NONE)
    assert "--may-change-mode" in bench.status().why_not_fly
    bench.vehicle.choose_mode(Mode.FOLLOW)
    bench.run(3.0)
    assert bench.vehicle.mode is Mode.FOLLOW  # PX4 stays in it because targets arrive
    assert bench.status().why_not_fly == ""
    bench.goal(10.0, 0.0, 8.0)
    bench.run_until("it is there", lambda: bench.place.distance_m(Location(10.0, 0.0, 8.0)) < 0.5)
    assert bench.commands() == []


@BOTH
def test_it_changes_the_mode_only_from_holding(autopilot: Autopilot) -> None:
    bench = _in_the_air(autopilot, Permissions(may_change_mode=True))
    bench.goal(10.0, 0.0, 8.0)
    bench.reach(Phase.HOLDING)
    assert set(bench.commands()) == {mavlink.MAV_CMD_DO_SET_MODE}


# What ends a flight --------------------------------------------------------------------------


def _pilot_takes_over(bench: Bench) -> None:
    bench.vehicle.choose_mode(Mode.PILOT)


def _autopilot_goes_home(bench: Bench) -> None:
    bench.vehicle.choose_mode(Mode.RETURN)


def _stick(bench: Bench) -> None:
    bench.vehicle.faults.stick_us = 1700


def _no_fix(bench: Bench) -> None:
    bench.vehicle.faults.fix_type = 2


def _estimate(bench: Bench) -> None:
    bench.vehicle.faults.estimate_good = False


def _stale(bench: Bench) -> None:
    bench.vehicle.faults.positions_stop = True


def _fence(bench: Bench) -> None:
    bench.vehicle.faults.fence_breached = True


def _battery(bench: Bench) -> None:
    bench.vehicle.body.battery_percent = 29.0


def _battery_unknown(bench: Bench) -> None:
    bench.vehicle.faults.battery_known = False


def _silence(bench: Bench) -> None:
    bench.vehicle.faults.silent = True


def _failsafe(bench: Bench) -> None:
    bench.vehicle.in_failsafe = True


@BOTH
@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (_pilot_takes_over, "(STABILIZE|POSCTL) was chosen: the pilot flies"),
        (_autopilot_goes_home, "RTL was chosen: the pilot flies"),
        (_stick, "the pilot moved the sticks"),
        (_no_fix, "the GPS has no 3D fix"),
        (_estimate, "does not trust its position estimate|reports a failsafe"),
        (_stale, "no position for more than 2 s"),
        (_fence, "outside the autopilot's fence|reports a failsafe"),
        (_battery, "battery at 29 %, below --min-battery 30"),
        (_battery_unknown, "the battery's charge is not reported"),
        (_silence, "no report from the|no position|no heartbeat"),
        (_failsafe, "the autopilot reports a failsafe"),
    ],
)
def test_a_flight_ends_at_once_and_its_reason_is_logged(
    autopilot: Autopilot,
    happens: Callable[[Bench], None],
    why: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = _on_its_way(autopilot)
    where_m = bench.place.latitude
    happens(bench)
    bench.run_until("it let go", lambda: not bench.status().is_flying, within_s=4.0)
    assert re.search(f"the flight ends: .*({why})", caplog.text)
    bench.run(1.0)
    assert bench.status().goal is None
    with pytest.raises(GoalRefused, match="the drone cannot fly: "):
        bench.goal(50.0, 0.0, 8.0)
    bench.run(10.0)
    assert bench.place.latitude < where_m + 20.0
    assert set(bench.commands()) <= {mavlink.MAV_CMD_DO_SET_MODE}  # that of the beginning


@BOTH
def test_after_a_pilot_took_over_not_one_target_is_sent(autopilot: Autopilot) -> None:
    bench = _on_its_way(autopilot)
    bench.vehicle.choose_mode(Mode.PILOT)
    bench.run_until("it noticed", lambda: not bench.status().is_flying, within_s=2.0)
    bench.down.sent.clear()
    bench.run(10.0)
    targets = bench.targets()
    if autopilot is ARDUPILOT:
        assert targets == []
    else:  # PX4's pilot may hand it back only while targets arrive: to stay where it is
        assert all(t.distance_m(bench.place) < 1.0 for t in targets)


@BOTH
def test_handing_the_drone_back_does_not_resume_the_flight(autopilot: Autopilot) -> None:
    bench = _on_its_way(autopilot)
    bench.vehicle.choose_mode(Mode.HOLD)
    bench.run(3.0)
    place = bench.place
    bench.vehicle.choose_mode(Mode.FOLLOW)
    bench.run(20.0)
    assert bench.status().phase in (Phase.IDLE, Phase.HOLDING)
    assert bench.place.distance_m(place) < 1.0
    assert bench.status().why_not_fly == ""


def test_an_autopilot_that_refuses_to_arm_ends_the_flight() -> None:
    bench = Bench()
    bench.vehicle.faults.refuses_to_arm = True
    bench.ready()
    bench.goal(10.0, 0.0, 5.0)
    bench.run_until("it gave up", lambda: not bench.status().is_flying, within_s=10.0)
    assert not bench.vehicle.body.armed
    assert bench.place.height == 0.0


@BOTH
def test_when_the_program_dies_in_flight_the_autopilot_lands_the_drone(
    autopilot: Autopilot,
) -> None:
    bench = _on_its_way(autopilot)
    bench.down.broken = True
    bench.run(60.0)
    assert bench.vehicle.mode is Mode.LAND
    assert bench.place.height == 0.0


# Where it is ---------------------------------------------------------------------------------


def test_without_a_vehicle_it_says_so_and_sends_only_heartbeats() -> None:
    bench = Bench()
    bench.vehicle.faults.silent = True
    bench.run(20.0)
    assert bench.status().why_not_fly.startswith("no heartbeat")
    assert bench.status().location is None
    assert {m.get_type() for m in bench.down.sent} == {"HEARTBEAT"}


def test_a_home_far_from_the_origin_is_refused() -> None:
    bench = Bench()
    bench.vehicle.home = type(bench.vehicle.home)(51.9, 4.5, 0.0)  # Rotterdam, not Utrecht
    bench.ready()
    assert bench.status().why_not_fly == "its home is more than 5 km from --origin"


def test_a_plane_or_a_ground_station_is_not_taken_for_a_drone() -> None:
    bench = Bench()
    bench.vehicle.faults.silent = True
    for kind, autopilot in (
        (mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID),
    ):
        bench.up.send(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 0, 3))
    bench.run(1.0)
    assert bench.status().autopilot == ""


def test_a_second_vehicle_on_the_line_is_ignored() -> None:
    bench = _in_the_air(ARDUPILOT)
    other = mavlink.MAVLink(None, 2, 1)
    codec = mavlink.MAVLink(None)
    stranger = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, 5, 3
    )
    (heard,) = codec.parse_buffer(stranger.pack(other))
    before = bench.status()
    bench.pilot.on_message(heard, bench.now_s)
    assert bench.status() == before


# Parameters ----------------------------------------------------------------------------------


@BOTH
def test_a_safe_set_of_parameters_raises_no_complaint(autopilot: Autopilot) -> None:
    bench = Bench(autopilot).ready()
    bench.run(10.0)
    assert bench.status().complaints == ()


@pytest.mark.parametrize(
    ("autopilot", "name", "value", "complaint"),
    [
        (ARDUPILOT, "FS_GCS_ENABLE", 0.0, "FS_GCS_ENABLE is 0"),
        (ARDUPILOT, "SYSID_MYGCS", 250.0, "SYSID_MYGCS is 250"),
        (ARDUPILOT, "FENCE_ENABLE", 0.0, "FENCE_ENABLE is 0"),
        (PX4, "COM_OBL_RC_ACT", 0.0, "COM_OBL_RC_ACT is 0"),
        (PX4, "COM_OF_LOSS_T", 30.0, "COM_OF_LOSS_T is 30"),
        (PX4, "GF_MAX_HOR_DIST", 0.0, "GF_MAX_HOR_DIST is 0"),
    ],
)
def test_a_parameter_that_is_not_safe_is_named(
    autopilot: Autopilot, name: str, value: float, complaint: str
) -> None:
    bench = Bench(autopilot)
    bench.vehicle.parameters[name] = value
    bench.ready()
    bench.run(15.0)
    (told,) = bench.status().complaints
    assert told.startswith(complaint)


def test_the_charge_may_be_unknown_when_no_least_charge_is_asked_for() -> None:
    bench = Bench(limits=FlightLimits(min_battery_percent=0.0))
    bench.vehicle.faults.battery_known = False
    assert bench.ready().status().why_not_fly == ""


def test_every_target_is_a_position_alone() -> None:
    bench = _on_its_way(ARDUPILOT)
    masks = {m.type_mask for m in bench.down.sent if m.get_type() == TARGET}
    assert masks == {0b110111111000}
