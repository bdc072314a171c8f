"""Commands are repeated, waited for and given up by what the autopilot says and does."""

from __future__ import annotations

import random

import pytest
from mavlink_rig import ARDUPILOT, Rig, in_flight
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.commander import PendingCommand
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.errors import GoalRefused

BOTH = pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda a: a.name)
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


def sent(command: PendingCommand, from_s: float, to_s: float) -> list[float]:
    """When it is sent, if it is asked ten times a second."""
    times = []
    for tenth in range(round(from_s * 10), round(to_s * 10)):
        if command.is_due(tenth / 10):
            command.sent_at(tenth / 10)
            times.append(tenth / 10)
    return times


def test_without_an_answer_it_is_repeated_every_second_until_its_time_is_over() -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=4.0, once=False)
    assert sent(command, 0.0, 3.9) == [0.0, 1.0, 2.0, 3.0]
    assert command.refusal(3.9) == ""
    assert command.refusal(4.0) == "the autopilot did not answer within 4 s"
    assert sent(command, 4.0, 9.0) == []


def test_silence_is_no_reason_to_repeat_what_must_be_done_once() -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=4.0, once=True)
    assert sent(command, 0.0, 4.0) == [0.0]


@pytest.mark.parametrize("result", [mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS])
def test_once_it_is_accepted_only_its_effect_is_waited_for(result: int) -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=20.0, once=False)
    assert sent(command, 0.0, 0.5) == [0.0]
    command.acknowledged(result, 0.5)
    assert sent(command, 0.5, 19.9) == []
    assert command.refusal(19.9) == ""
    assert command.refusal(20.0) == "the autopilot accepted it, nothing happened for 20 s"


@pytest.mark.parametrize(
    ("result", "name"), [(mavlink.MAV_RESULT_FAILED, "failed"), (6, "result 6")]
)
def test_what_fails_while_it_is_carried_out_is_refused_at_once(result: int, name: str) -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=20.0, once=False)
    assert sent(command, 0.0, 0.5) == [0.0]
    for told in (mavlink.MAV_RESULT_IN_PROGRESS, mavlink.MAV_RESULT_TEMPORARILY_REJECTED, result):
        command.acknowledged(told, 0.5)
    assert command.refusal(2.0) == f"the autopilot refused: {name}"


@pytest.mark.parametrize("once", [False, True])
def test_a_command_that_is_put_off_is_sent_again_a_second_later(once: bool) -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=20.0, once=once)
    assert sent(command, 0.0, 0.5) == [0.0]
    command.acknowledged(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, 0.5)
    assert sent(command, 0.5, 2.0) == [1.0]
    command.acknowledged(mavlink.MAV_RESULT_ACCEPTED, 2.0)
    assert sent(command, 2.0, 9.0) == []


def test_it_is_given_up_in_the_autopilot_s_own_words_even_if_they_come_after_the_refusal() -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=20.0, once=False)
    assert sent(command, 0.0, 0.5) == [0.0]
    command.acknowledged(mavlink.MAV_RESULT_FAILED, 0.5)
    command.words = "PreArm: Need 3D Fix"
    assert command.refusal(1.9) == ""
    assert command.refusal(2.0) == "PreArm: Need 3D Fix"


def test_without_words_the_result_is_the_reason() -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=20.0, once=False)
    assert sent(command, 0.0, 0.5) == [0.0]
    command.acknowledged(mavlink.MAV_RESULT_DENIED, 0.5)
    assert command.refusal(2.0) == "the autopilot refused: denied"


def test_a_repetition_that_is_refused_does_not_undo_what_was_accepted() -> None:
    command = PendingCommand(ARM, (1.0,), 0.0, within_s=20.0, once=False)
    assert sent(command, 0.0, 1.5) == [0.0, 1.0]
    command.acknowledged(mavlink.MAV_RESULT_ACCEPTED, 1.5)
    command.acknowledged(mavlink.MAV_RESULT_FAILED, 1.6)
    assert command.refusal(19.0) == ""


# In flight -----------------------------------------------------------------------------------


@BOTH
def test_motors_that_spool_up_for_long_are_waited_for(autopilot: Autopilot) -> None:
    rig = Rig(autopilot)
    rig.vehicle.faults.spool_up_s = 9.0
    rig.ready()
    rig.goal(10.0, 0.0, 5.0)
    rig.reach(Phase.HOLDING)
    assert rig.commands().count(mavlink.MAV_CMD_NAV_TAKEOFF) <= 1


def test_a_drone_that_never_leaves_the_ground_is_given_up_with_the_reason() -> None:
    rig = Rig()
    rig.vehicle.faults.spool_up_s = 1e6
    rig.ready()
    rig.goal(10.0, 0.0, 5.0)
    rig.run_until("it gave up", lambda: not rig.status().is_flying, within_s=60.0)
    assert rig.status().ended.startswith("taking off: ") or rig.status().ended == "disarmed"


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ((255, mavlink.MAV_COMP_ID_MISSIONPLANNER), ""),  # QGroundControl, also system 255
        ((254, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER), ""),
        ((255, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER), "landing: the autopilot refused: denied"),
        ((0, 0), "landing: the autopilot refused: denied"),  # MAVLink 1, and older releases
    ],
)
def test_what_the_autopilot_answers_to_another_program_is_no_answer_to_this_one(
    target: tuple[int, int], why: str
) -> None:
    rig = in_flight(ARDUPILOT)
    rig.down.loses = lambda: rig.status().phase is Phase.LANDING
    rig.goal(0.0, 0.0, 0.0, lands=True)
    rig.reach(Phase.LANDING)
    land, denied = mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_RESULT_DENIED
    rig.step()
    rig.up.send(mavlink.MAVLink_command_ack_message(land, denied, 0, 0, *target))
    rig.run(2.0)
    rig.down.loses = lambda: False
    assert rig.status().ended == why
    if not why:
        rig.run_until("it has landed", lambda: rig.place.height == 0.0)


@BOTH
def test_an_autopilot_that_refuses_to_arm_is_quoted(autopilot: Autopilot) -> None:
    rig = Rig(autopilot)
    rig.vehicle.faults.refuses_to_arm = True
    rig.ready()
    rig.goal(10.0, 0.0, 5.0)
    rig.run_until("it gave up", lambda: not rig.status().is_flying, within_s=10.0)
    assert rig.status().ended == "arming: PreArm: not ready"
    assert rig.commands().count(ARM) == 1


@BOTH
@pytest.mark.parametrize("seed", [0, 2, 6, 7])  # find each defect that range(10) finds
def test_on_a_line_that_loses_one_message_in_twenty_a_flight_goes_up_across_and_down(
    autopilot: Autopilot, seed: int
) -> None:
    rig = Rig(autopilot)
    rng = random.Random(seed)
    rig.up.loses = rig.down.loses = lambda: rng.random() < 0.05
    rig.ready().run(12.0)  # all reports arrive at the rates that were asked for
    rig.goal(20.0, 10.0, 0.0, lands=True)
    rig.run_until("the flight is over", lambda: not rig.status().is_flying)
    assert rig.status().ended == ""
    assert rig.place.distance_m(Location(20.0, 10.0, 0.0)) < 1.0
    assert not rig.vehicle.body.armed


@BOTH
def test_a_flight_that_makes_no_progress_ends_and_no_repair_follows(autopilot: Autopilot) -> None:
    rig = Rig(autopilot).ready()
    rig.goal(100.0, 0.0, 5.0)
    rig.run_until("it is on its way", lambda: rig.place.latitude > 10.0)
    rig.vehicle.body.speed_m_s = 0.0  # as at a fence, beyond which it takes no targets
    rig.run_until("it gave up", lambda: not rig.status().is_flying, within_s=25.0)
    assert rig.status().ended == "the drone has not moved for 20 s"
    rig.vehicle.body.speed_m_s = 5.0
    with pytest.raises(GoalRefused, match="the last flight made no progress"):
        rig.repair(0.0, 0.0, 5.0)
    assert rig.status().why_not_repair == "the last flight made no progress"
    rig.goal(0.0, 0.0, 5.0)  # an order may try elsewhere
    rig.reach(Phase.HOLDING)
    assert rig.status().why_not_repair == ""
