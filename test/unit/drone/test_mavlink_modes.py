"""Who may leave a mode: every kind of mode of every autopilot, and every way into it.

An aircraft that anybody but the engine put into a mode belongs to its pilot until he gives it back
by choosing GUIDED or OFFBOARD. A repair never takes it; an order only with --orders-may-take-back.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any, Callable

import pytest
from mavlink_rig import ALL, ARDUPILOT, ORIGIN, STEP_S, Rig, in_flight, lift
from mavlink_vehicle.modes import Mode, mode_number
from mavlink_vehicle.vehicle import MavlinkVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot, px4_mode
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.errors import ConfigurationError, GoalRefused

BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)
TAKE_BACK = replace(ALL, orders_may_take_back_s=0.0)

# Who may leave a mode, once somebody chose it: "engine" flies in it, "order" leaves it with
# --orders-may-take-back, "pilot" alone leaves it. Nothing but the pilot leaves any other mode.
ENGINE, ORDER, PILOT = "engine", "order", "pilot"

# One mode of each kind: the engine's own, those to hold and to land, another, an unknown one.
EVERY_KIND_OF_MODE = pytest.mark.parametrize(
    ("autopilot", "mode", "who"),
    [
        pytest.param(ARDUPILOT, mavlink.COPTER_MODE_GUIDED, ENGINE, id="GUIDED"),
        pytest.param(ARDUPILOT, mavlink.COPTER_MODE_LOITER, ORDER, id="LOITER"),
        pytest.param(ARDUPILOT, mavlink.COPTER_MODE_LAND, PILOT, id="LAND"),
        pytest.param(ARDUPILOT, mavlink.COPTER_MODE_AUTO, PILOT, id="AUTO"),
        pytest.param(ARDUPILOT, 99, PILOT, id="a mode of a later ArduPilot"),
        pytest.param(PX4, px4_mode(6), ENGINE, id="OFFBOARD"),  # px4_custom_mode.h
        pytest.param(PX4, px4_mode(4, 3), ORDER, id="HOLD"),
        pytest.param(PX4, px4_mode(4, 6), PILOT, id="AUTO.LAND"),
        pytest.param(PX4, px4_mode(7), PILOT, id="STABILIZED"),
        pytest.param(PX4, px4_mode(4, 11), PILOT, id="a mode of a later PX4"),
    ],
)


def refuses(rig: Rig, ask: Callable[[float, float, float], None]) -> bool:
    try:
        ask(50.0, 20.0, 8.0)
    except GoalRefused:
        return True
    return False


@EVERY_KIND_OF_MODE
@pytest.mark.parametrize("permissions", [ALL, TAKE_BACK], ids=["default", "take back"])
def test_a_mode_that_somebody_chose_in_flight_is_left_by_nobody_else(
    autopilot: Autopilot, mode: int, who: str, permissions: Permissions
) -> None:
    rig = in_flight(autopilot, permissions)
    rig.shown_mode = mode
    rig.run(3.0)
    assert (rig.status().phase is Phase.FLYING) is (who == ENGINE)
    order_goes = who == ENGINE or (who == ORDER and permissions is TAKE_BACK)
    assert refuses(rig, rig.repair) is (who != ENGINE)
    assert (rig.status().why_not_repair == "") is (who == ENGINE)
    rig.run(20.0)  # waiting does not help
    assert refuses(rig, rig.repair) is (who != ENGINE)
    assert rig.commands() == []
    assert (rig.status().why_not_fly == "") is order_goes
    assert refuses(rig, rig.goal) is not order_goes


@EVERY_KIND_OF_MODE
def test_a_mode_that_was_found_in_the_air_counts_as_chosen(
    autopilot: Autopilot, mode: int, who: str
) -> None:
    rig = Rig(autopilot)
    lift(rig.vehicle, 8.0)
    rig.shown_mode = mode
    rig.ready()
    assert refuses(rig, rig.repair) is (who != ENGINE)
    assert refuses(rig, rig.goal) is (who != ENGINE)


@EVERY_KIND_OF_MODE
def test_from_the_ground_only_a_drone_that_nobody_has_touched_is_taken(
    autopilot: Autopilot, mode: int, who: str
) -> None:
    rig = Rig(autopilot)
    rig.shown_mode = mode
    rig.ready()
    assert (rig.status().why_not_repair == "") is (who != PILOT)
    assert (rig.status().why_not_fly == "") is (who != PILOT)
    rig.vehicle.arm()  # the pilot does
    rig.run(1.5)
    assert (rig.status().why_not_repair == "") is (who == ENGINE)
    assert (rig.status().why_not_fly == "") is (who == ENGINE)


@pytest.mark.parametrize("mode", [mavlink.PLANE_MODE_GUIDED, mavlink.COPTER_MODE_GUIDED])
@pytest.mark.parametrize(
    "kind",
    [
        mavlink.MAV_TYPE_FIXED_WING,
        mavlink.MAV_TYPE_VTOL_TILTROTOR,
        mavlink.MAV_TYPE_VTOL_QUADROTOR,
        mavlink.MAV_TYPE_GCS,
    ],
)
def test_a_plane_is_flown_in_no_mode_at_all(kind: int, mode: int) -> None:
    rig = Rig()
    rig.vehicle.faults.silent = True
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    for _ in range(5):
        rig.up.send(
            mavlink.MAVLink_heartbeat_message(
                kind, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, armed, mode, 4, 3
            )
        )
        rig.run(1.0)
    assert rig.status().why_not_repair == "the vehicle is not a multirotor with ArduPilot or PX4"
    assert refuses(rig, rig.repair)
    assert refuses(rig, rig.goal)
    assert {m.get_type() for m in rig.down.sent} == {"HEARTBEAT"}


def _kill(rig: Rig) -> None:
    """The pilot's kill switch: it falls."""
    rig.vehicle.body.armed = False
    rig.vehicle.body.place = rig.place._replace(height=0.0)


# The ways in ---------------------------------------------------------------------------------


def _rc(rig: Rig) -> None:
    rig.vehicle.choose_mode(Mode.HOLD)


def _gcs(rig: Rig) -> None:
    codec, station = mavlink.MAVLink(None), mavlink.MAVLink(None, 254, 190)
    autopilot = rig.vehicle.autopilot
    hold = mode_number(autopilot, Mode.HOLD)
    command = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1.0, *autopilot.mode_parameters(hold), 0, 0, 0, 0
    )
    (heard,) = codec.parse_buffer(command.pack(station))
    rig.vehicle.on_message(heard, rig.now_s)


def _failsafe(rig: Rig) -> None:
    rig.vehicle._fail_to(Mode.HOLD)  # as PX4 does by default, and ArduPilot with FS_OPTIONS


def _node_hung(rig: Rig) -> None:
    rig.down.broken = True
    rig.run(10.0)
    rig.down.broken = False


def _fence(rig: Rig) -> None:
    rig.vehicle.faults.fence_breached = True
    rig.run(2.0)
    rig.vehicle.faults.fence_breached = False


def _battery(rig: Rig) -> None:
    rig.vehicle.body.battery_percent = 14.0
    rig.run(2.0)
    rig.vehicle.body.battery_percent = 90.0


def _ekf(rig: Rig) -> None:
    rig.vehicle.faults.estimate_good = False
    rig.run(2.0)
    rig.vehicle.faults.estimate_good = True


@BOTH
@pytest.mark.parametrize("way_in", [_rc, _gcs, _failsafe, _node_hung, _fence, _battery, _ekf])
def test_whoever_chose_the_mode_the_aircraft_stays_his_until_it_is_given_back(
    autopilot: Autopilot, way_in: Callable[[Rig], None]
) -> None:
    rig = in_flight(autopilot)
    way_in(rig)
    rig.run(3.0)
    rig.vehicle.in_failsafe = False  # the reason is gone, the mode remains
    assert rig.vehicle.mode is not Mode.FOLLOW
    assert not rig.status().is_flying
    assert rig.status().ended
    for _ in range(4):
        rig.run(10.0)
        assert refuses(rig, rig.repair)
        assert refuses(rig, rig.goal)
    assert rig.commands() == []
    lift(rig.vehicle, 8.0)
    rig.run(3.0)  # PX4 accepts OFFBOARD only while targets arrive
    rig.vehicle.choose_mode(Mode.FOLLOW)  # the pilot gives it back
    rig.run_until("it can fly", lambda: not rig.status().why_not_repair, within_s=3.0)
    rig.repair(50.0, 20.0, 8.0)
    rig.run_until("it flies", lambda: rig.status().phase is Phase.FLYING)


@BOTH
def test_an_order_takes_a_hovering_drone_back_after_the_time_that_the_operator_set(
    autopilot: Autopilot,
) -> None:
    rig = in_flight(autopilot, replace(ALL, orders_may_take_back_s=60.0))
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.run(5.0)
    with pytest.raises(GoalRefused, match="flown by its pilot: not yet, for 5[5-9] s"):
        rig.goal(50.0, 0.0, 8.0)
    rig.run(56.0)
    assert "flown by its pilot: this needs" in rig.status().why_not_repair
    rig.goal(50.0, 0.0, 8.0)
    rig.reach(Phase.HOLDING)
    assert rig.status().why_not_repair == ""  # the order gave it back to the mesh


@BOTH
def test_a_drone_that_was_ordered_to_land_may_repair_and_one_that_its_pilot_landed_may_not(
    autopilot: Autopilot,
) -> None:
    rig = in_flight(autopilot)
    rig.goal(30.0, 0.0, 0.0, lands=True)
    rig.run_until("it has landed", lambda: rig.status().phase is Phase.IDLE)
    rig.run(2.0)
    assert rig.status().why_not_repair == ""
    rig.repair(0.0, 0.0, 6.0)
    rig.reach(Phase.HOLDING)
    rig.vehicle.choose_mode(Mode.LAND)
    rig.run_until("it has landed", lambda: not rig.vehicle.body.armed)
    rig.run(2.0)
    assert "flown by its pilot" in rig.status().why_not_repair
    assert "flown by its pilot" in rig.status().why_not_fly


@BOTH
def test_a_failsafe_during_an_ordered_landing_makes_it_the_autopilot_s_landing(
    autopilot: Autopilot,
) -> None:
    rig = in_flight(autopilot)
    rig.goal(30.0, 0.0, 0.0, lands=True)
    rig.reach(Phase.LANDING)
    rig.run(3.0)
    rig.vehicle.in_failsafe = True
    rig.run(2.0)
    rig.vehicle.in_failsafe = False
    rig.run_until("it has landed", lambda: not rig.vehicle.body.armed)
    rig.run(2.0)
    assert "flown by its pilot" in rig.status().why_not_repair


def _holds(autopilot: Autopilot) -> Rig:
    rig = in_flight(autopilot)
    rig.reach(Phase.HOLDING)
    return rig


def _takes_off(autopilot: Autopilot) -> Rig:
    rig = Rig(autopilot)
    rig.vehicle.faults.spool_up_s = 5.0
    rig.ready()
    rig.goal(50.0, 0.0, 8.0)
    rig.run_until("it is armed", lambda: rig.status().armed, within_s=20.0)
    return rig


@BOTH
@pytest.mark.parametrize("prepared", [in_flight, _holds, _takes_off])
def test_a_drone_that_its_pilot_disarmed_stays_down_until_he_gives_it_back(
    autopilot: Autopilot, prepared: Callable[[Autopilot], Rig]
) -> None:
    rig = prepared(autopilot)
    rig.down.sent.clear()
    _kill(rig)
    rig.run(2.0)
    rig.down.sent.clear()
    for _ in range(4):
        rig.run(10.0)
        for why in (rig.status().why_not_fly, rig.status().why_not_repair):
            assert re.fullmatch("disarmed: its pilot has to arm, or choose .* again", why)
        assert refuses(rig, rig.repair)
        assert refuses(rig, rig.goal)
    assert rig.commands() == []
    assert rig.targets() == []
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.run(2.0)
    assert refuses(rig, rig.goal)
    assert rig.place.height == 0.0
    rig.vehicle.arm()
    rig.vehicle.choose_mode(Mode.PILOT)
    lift(rig.vehicle, 8.0)
    rig.run(3.0)  # PX4 accepts OFFBOARD only while targets arrive
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run_until("it can fly", lambda: not rig.status().why_not_repair, within_s=3.0)


def test_a_disarmed_drone_is_given_back_by_choosing_guided_again() -> None:
    rig = in_flight(ARDUPILOT)
    _kill(rig)
    rig.run(2.0)
    rig.vehicle.choose_mode(Mode.PILOT)
    rig.run(2.0)
    assert refuses(rig, rig.goal)
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run(2.0)
    rig.goal(50.0, 0.0, 8.0)
    rig.reach(Phase.HOLDING)


@BOTH
def test_the_mode_that_an_autopilot_restarts_in_is_its_pilots_as_is_one_that_others_chose(
    autopilot: Autopilot,
) -> None:
    """The engine cannot tell them apart, and does not take a drone that is being handled."""
    rig = in_flight(autopilot)
    rig.goal(30.0, 0.0, 0.0, lands=True)
    rig.reach(Phase.LANDING)
    rig.reach(Phase.IDLE)
    rig.run(10.0)
    rig.up.broken = True
    rig.run(5.0)
    rig.up.broken = False
    rig.vehicle = MavlinkVehicle(autopilot, ORIGIN, rig.up.send)
    rig.ready()
    assert "flown by its pilot" in rig.status().why_not_fly
    rig.vehicle.choose_mode(Mode.FOLLOW)
    rig.run(2.0)
    rig.goal(50.0, 0.0, 8.0)
    rig.reach(Phase.HOLDING)


def _sinks(autopilot: Autopilot) -> Rig:
    """In the air, during an ordered landing."""
    rig = in_flight(autopilot)
    rig.goal(30.0, 0.0, 0.0, lands=True)
    rig.reach(Phase.LANDING)
    rig.run_until("it sinks", lambda: rig.place.height < 7.0)
    return rig


@BOTH
def test_a_drone_that_its_pilot_disarmed_in_the_air_during_an_ordered_landing_stays_down(
    autopilot: Autopilot,
) -> None:
    rig = _sinks(autopilot)
    _kill(rig)
    rig.run(5.0)
    assert rig.status().why_not_repair.startswith("disarmed: its pilot has to arm")
    assert refuses(rig, rig.goal)


@BOTH
@pytest.mark.parametrize("asked", ["goal", "repair"])
def test_nor_is_it_armed_by_what_is_asked_for_in_the_moment_after(
    autopilot: Autopilot, asked: str
) -> None:
    rig = _sinks(autopilot)
    _kill(rig)
    for _ in range(round(15.0 / STEP_S)):
        refuses(rig, getattr(rig, asked))
        rig.step()
        assert not rig.vehicle.body.armed


def test_nor_when_its_height_is_unknown_for_a_while() -> None:
    rig = _sinks(ARDUPILOT)
    _kill(rig)
    rig.vehicle.faults.estimate_good = False
    rig.run(8.0)
    rig.vehicle.faults.estimate_good = True
    rig.run(3.0)
    assert rig.status().why_not_repair.startswith("disarmed: its pilot has to arm")


@BOTH
def test_a_disarming_right_after_the_arming_counts(autopilot: Autopilot) -> None:
    rig = Rig(autopilot)
    rig.ready()
    rig.goal(50.0, 0.0, 8.0)
    rig.run_until("it arms", lambda: rig.vehicle.body.armed)
    rig.run(0.2)
    assert not rig.status().armed  # no heartbeat has told yet
    rig.vehicle.body.armed = False
    rig.run(12.0)
    assert refuses(rig, rig.repair)
    assert not rig.vehicle.body.armed


def test_a_flight_ends_for_a_node_that_missed_how_its_pilot_disarmed_and_gave_back() -> None:
    rig = in_flight(ARDUPILOT)
    vehicle, missed = rig.vehicle, []
    for change in (_kill, lambda _rig: vehicle.choose_mode(Mode.PILOT), _gives_back):
        change(rig)
        for _ in range(round(1.2 / STEP_S)):
            rig.now_s += STEP_S
            vehicle._ground_station_s = rig.now_s  # its own pilot's
            vehicle.tick(rig.now_s)
        missed += rig.up.take()
    for message in missed:
        rig.pilot.on_message(message, rig.now_s)
    rig.run(2.0)
    vehicle.arm()
    lift(vehicle, 3.0)
    before = rig.place
    rig.run(10.0)
    assert rig.status().ended == "disarmed"
    assert rig.place == before


def _gives_back(rig: Rig) -> None:
    rig.vehicle.choose_mode(Mode.FOLLOW)


@pytest.mark.parametrize("late_s", [0.1, 0.3, 0.6])
def test_a_change_of_mode_that_was_ordered_before_gives_nothing_back(late_s: float) -> None:
    rig = in_flight(ARDUPILOT, TAKE_BACK)
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.run(3.0)
    on_message, late = rig.vehicle.on_message, []

    def delayed(message: Any, now_s: float) -> None:
        is_mode = message.get_type() == "COMMAND_LONG"
        if is_mode and message.command == mavlink.MAV_CMD_DO_SET_MODE:
            late.append((now_s + late_s, message))
        else:
            on_message(message, now_s)

    rig.vehicle.on_message = delayed
    rig.goal(50.0, 0.0, 8.0)
    rig.step()
    (due_s, order), *_ = late
    _kill(rig)
    rig.run(due_s - rig.now_s)
    on_message(order, rig.now_s)
    rig.run(8.0)
    assert rig.vehicle.mode is Mode.FOLLOW
    assert refuses(rig, rig.goal)
    assert rig.status().why_not_repair.startswith("disarmed: its pilot has to arm")


def _flown_on() -> Rig:
    """The mesh flew it to 20 m, and its ground station to 60 m."""
    rig = in_flight(ARDUPILOT)
    rig.goal(20.0, 0.0, 8.0)
    rig.reach(Phase.HOLDING)
    rig.run(5.0)
    rig.vehicle._target = Location(60.0, 0.0, 8.0)
    rig.run_until("it is there", lambda: rig.place.latitude > 59.9, within_s=60.0)
    return rig


def _empty_battery(rig: Rig) -> None:
    rig.vehicle.body.battery_percent = 28.0


def _sticks(rig: Rig) -> None:
    rig.vehicle.faults.stick_us = 1700


@pytest.mark.parametrize("reason", [_empty_battery, _sticks])
def test_a_copter_that_was_flown_on_in_guided_is_not_flown_back_for_any_reason(
    reason: Callable[[Rig], None],
) -> None:
    rig = _flown_on()
    rig.down.sent.clear()
    reason(rig)
    rig.run(20.0)
    assert rig.targets() == []
    assert rig.place.latitude == pytest.approx(60.0, abs=0.1)


def test_a_copter_that_was_flown_on_in_guided_flies_back_when_that_is_ordered() -> None:
    rig = _flown_on()
    rig.goal(20.0, 0.0, 8.0)
    rig.run_until("it is back", lambda: rig.place.latitude < 21.0, within_s=60.0)


@BOTH
def test_the_pilot_who_chooses_again_while_the_mode_changes_is_not_overruled(
    autopilot: Autopilot,
) -> None:
    rig = in_flight(autopilot, TAKE_BACK)
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.run(3.0)
    rig.goal(50.0, 0.0, 8.0)
    rig.run_until("it follows", lambda: rig.vehicle.mode is Mode.FOLLOW, within_s=5.0)
    rig.vehicle.choose_mode(Mode.HOLD)  # before a heartbeat told of the change
    rig.run(30.0)
    assert rig.vehicle.mode is Mode.HOLD
    assert rig.commands() == [mavlink.MAV_CMD_DO_SET_MODE]
    assert not rig.status().is_flying
    assert rig.status().ended


@BOTH
def test_a_lost_acknowledgement_does_not_repeat_the_change_of_mode_in_the_air(
    autopilot: Autopilot,
) -> None:
    rig = in_flight(autopilot, TAKE_BACK)
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.run(3.0)
    rig.goal(50.0, 0.0, 8.0)
    rig.run_until("it was ordered", lambda: bool(rig.commands()), within_s=5.0)
    rig.vehicle.choose_mode(Mode.HOLD)
    rig.up.take()  # the acknowledgement is lost
    rig.run(30.0)
    assert rig.commands() == [mavlink.MAV_CMD_DO_SET_MODE]
    assert rig.vehicle.mode is Mode.HOLD


@pytest.mark.parametrize(
    ("permissions", "why"),
    [
        ({"may_change_mode": True, "orders_may_take_back_s": -1.0}, "is not a time"),
        ({"may_change_mode": True, "orders_may_take_back_s": float("nan")}, "is not a time"),
        ({"orders_may_take_back_s": 60.0}, "needs --may-change-mode"),
    ],
)
def test_a_permission_that_makes_no_sense_is_refused(permissions, why: str) -> None:
    with pytest.raises(ConfigurationError, match=f"--orders-may-take-back.* {why}"):
        Permissions(**permissions)


def test_every_reason_of_the_pilot_fits_into_a_reply_of_the_drone() -> None:
    longest = max(ARDUPILOT.mode_names.values(), key=len)
    rig = Rig(limits=FlightLimits())
    rig.shown_mode = next(n for n, name in ARDUPILOT.mode_names.items() if name == longest)
    reason = f"drone 100 cannot fly: {rig.ready().status().why_not_fly}"
    assert longest in reason
    assert len(reason) <= 80  # communication/wire/text_parts.py: 8 parts of 10 bytes
