"""The pilot has priority: what ends a flight, and what this program may not do."""

from __future__ import annotations

import re

import pytest
from mavlink_rig import (
    ARDUPILOT,
    NONE,
    TARGET,
    Rig,
    in_flight,
    in_the_air,
    lift,
)
from mavlink_vehicle.modes import Mode
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.errors import GoalRefused

BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)


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
    rig = Rig(autopilot, Permissions(**granted))
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.ready()
    assert why in rig.status().why_not_fly
    with pytest.raises(GoalRefused, match=why):
        rig.goal(10.0, 0.0, 5.0)
    rig.run(10.0)
    assert rig.commands() == []
    assert not rig.vehicle.body.armed
    assert rig.place.height == 0.0


@BOTH
def test_it_never_takes_control_from_a_pilot_who_flies_by_hand(autopilot: Autopilot) -> None:
    rig = Rig(autopilot)
    lift(rig.vehicle, 8.0)
    rig.vehicle.choose_mode(Mode.PILOT)
    rig.ready()
    assert "flown by its pilot" in rig.status().why_not_fly
    with pytest.raises(GoalRefused, match="flown by its pilot"):
        rig.goal(10.0, 0.0, 8.0)
    assert rig.commands() == []


@BOTH
def test_without_permissions_it_flies_when_the_pilot_hands_it_a_hovering_drone(
    autopilot: Autopilot,
) -> None:
    rig = in_the_air(autopilot, NONE)
    assert "flown by its pilot: this needs" in rig.status().why_not_fly
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run(3.0)
    assert rig.vehicle.mode is Mode.FOLLOW  # PX4 stays in it because targets arrive
    assert rig.status().why_not_fly == ""
    rig.goal(10.0, 0.0, 8.0)
    rig.run_until("it is there", lambda: rig.place.distance_m(Location(10.0, 0.0, 8.0)) < 0.5)
    assert rig.commands() == []


# What ends a flight --------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize(
    ("what", "value", "why"),
    [
        ("mode", Mode.PILOT, "(STABILIZE|POSCTL) was chosen: the pilot flies"),
        ("mode", Mode.RETURN, "RTL was chosen: the pilot flies"),
        ("stick_us", 1700, "the pilot moved the sticks"),
        ("fix_type", 2, "the GPS has no 3D fix"),
        ("estimate_good", False, "does not trust its position estimate|reports a failsafe"),
        ("positions_stop", True, "no position for more than 2 s"),
        ("fence_breached", True, "outside the autopilot's fence|reports a failsafe"),
        ("battery_percent", 29.0, "battery at 29 %, below --min-battery 30"),
        ("battery_known", False, "the battery's charge is not reported"),
        ("silent", True, "no report from the|no position|no heartbeat"),
        ("in_failsafe", True, "the autopilot reports a failsafe"),
    ],
)
def test_a_flight_ends_at_once_and_its_reason_is_logged(
    autopilot: Autopilot, what: str, value: object, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    rig = in_flight(autopilot)
    vehicle, where_m = rig.vehicle, rig.place.latitude
    if isinstance(value, Mode):
        vehicle.choose_mode(value)
    else:
        owners = (vehicle.faults, vehicle.body, vehicle)
        setattr(next(owner for owner in owners if hasattr(owner, what)), what, value)
    rig.run_until("it let go", lambda: not rig.status().is_flying, within_s=4.0)
    assert re.search(f"the flight ends: .*({why})", caplog.text)
    rig.run(1.0)
    assert rig.status().goal is None
    with pytest.raises(GoalRefused, match="the drone cannot fly: "):
        rig.goal(50.0, 0.0, 8.0)
    rig.run(10.0)
    assert rig.place.latitude < where_m + 20.0
    assert rig.commands() == []


@BOTH
def test_after_a_pilot_took_over_not_one_target_is_sent(autopilot: Autopilot) -> None:
    rig = in_flight(autopilot)
    rig.vehicle.choose_mode(Mode.PILOT)
    rig.run_until("it noticed", lambda: not rig.status().is_flying, within_s=2.0)
    rig.down.sent.clear()
    rig.run(10.0)
    targets = rig.targets()
    if autopilot is ARDUPILOT:
        assert targets == []
    else:  # PX4's pilot may hand it back only while targets arrive: to stay where it is
        assert all(t.distance_m(rig.place) < 1.0 for t in targets)


@BOTH
def test_handing_the_drone_back_does_not_resume_the_flight(autopilot: Autopilot) -> None:
    rig = in_flight(autopilot)
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.run(3.0)
    place = rig.place
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run(20.0)
    assert rig.status().phase in (Phase.IDLE, Phase.HOLDING)
    assert rig.place.distance_m(place) < 1.0
    assert rig.status().why_not_fly == ""


def test_the_target_of_a_ground_station_is_not_overruled_while_the_drone_holds() -> None:
    rig = in_flight(ARDUPILOT)
    rig.reach(Phase.HOLDING)
    rig.run(5.0)
    rig.down.sent.clear()
    rig.run(20.0)
    assert rig.targets() == []
    rig.goal(0.0, 0.0, 8.0)
    rig.reach(Phase.FLYING, within_s=1.0)


@BOTH
def test_when_the_program_dies_in_flight_the_autopilot_lands_the_drone(
    autopilot: Autopilot,
) -> None:
    rig = in_flight(autopilot)
    rig.down.broken = True
    rig.run(60.0)
    assert rig.vehicle.mode is Mode.LAND
    assert rig.place.height == 0.0


# Where it is ---------------------------------------------------------------------------------


def test_without_a_vehicle_it_says_so_and_sends_only_heartbeats() -> None:
    rig = Rig()
    rig.vehicle.faults.silent = True
    rig.run(20.0)
    assert rig.status().why_not_fly.startswith("no heartbeat")
    assert rig.status().location is None
    assert {m.get_type() for m in rig.down.sent} == {"HEARTBEAT"}


def test_a_home_far_from_the_origin_is_refused() -> None:
    rig = Rig()
    rig.vehicle.home = type(rig.vehicle.home)(51.9, 4.5, 0.0)  # Rotterdam, not Utrecht
    rig.ready()
    assert rig.status().why_not_fly == "its home is more than 5 km from --origin"


@pytest.mark.parametrize(
    ("altitude_m", "words"),
    [(49.0, "46 m above --origin"), (-43.0, "46 m below --origin"), (11.0, "")],
)
def test_a_home_at_another_height_than_the_origin_is_doubted_once(
    altitude_m: float, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    rig = Rig()  # its origin is at 3 m
    rig.vehicle.home = type(rig.vehicle.home)(52.0907, 5.1214, altitude_m)
    rig.ready().run(10.0)
    doubts = [r.message for r in caplog.records if "--origin" in r.message]
    assert len(doubts) == (1 if words else 0)
    assert all(words in message for message in doubts)


def test_a_second_vehicle_on_the_line_is_ignored() -> None:
    rig = in_the_air(ARDUPILOT)
    other = mavlink.MAVLink(None, 2, 1)
    codec = mavlink.MAVLink(None)
    stranger = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, 5, 3
    )
    (heard,) = codec.parse_buffer(stranger.pack(other))
    before = rig.status()
    rig.pilot.on_message(heard, rig.now_s)
    assert rig.status() == before


# Parameters ----------------------------------------------------------------------------------


@BOTH
def test_a_safe_set_of_parameters_raises_no_complaint(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.run(10.0)
    assert rig.status().complaints == ()


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
    rig = Rig(autopilot)
    rig.vehicle.parameters[name] = value
    rig.ready()
    rig.run(15.0)
    (told,) = rig.status().complaints
    assert told.startswith(complaint)


def test_the_charge_may_be_unknown_when_no_least_charge_is_asked_for() -> None:
    rig = Rig(limits=FlightLimits(min_battery_percent=0.0))
    rig.vehicle.faults.battery_known = False
    assert rig.ready().status().why_not_fly == ""


def test_every_target_is_a_position_alone() -> None:
    rig = in_flight(ARDUPILOT)
    masks = {m.type_mask for m in rig.down.sent if m.get_type() == TARGET}
    assert masks == {0b110111111000}
