"""What a ground station asks and orders, and how it is answered: at once, and as it is."""

from __future__ import annotations

import math

import pytest
from desk_rig import GCS, HERE, DeskRig, drone, long, reposition
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.location import Location
from drone_mesh.ground_station.reports import HOLD, LAND, RETURN

NAN = math.nan
ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = range(7)
GO_TO = mavlink.MAV_CMD_DO_REPOSITION
NORTH_DEG = 52.0 + 100 / 111_267  # 100 m north of the origin
IN_UNITS = round(NORTH_DEG * 1e7), 50000000
GUIDED = 4, 1, 0, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 16, 2, 0, 0, 0, 0, 0


def target(x, y, mask=0b110111111000):
    frame, rest = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, [0] * 8
    make = mavlink.MAVLink_set_position_target_global_int_message
    return make(0, 4, 1, frame, mask, x, y, 8.0, *rest)


def goal_of(rig):
    node, goal, _answer = rig.ordered[-1]
    assert node == 3
    return Location(*(round(metres) for metres in goal))


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (mavlink.MAVLink_param_request_list_message(4, 1), ("PARAM_VALUE", ("MESH_NODE_ID", 3.0))),
        (
            mavlink.MAVLink_param_set_message(4, 1, b"MESH_NODE_ID", 9.0, 9),
            ("PARAM_VALUE", ("MESH_NODE_ID", 3.0)),  # it cannot be set
        ),
        (mavlink.MAVLink_mission_request_list_message(4, 1, 0), ("MISSION_COUNT", (0, 0))),
        (mavlink.MAVLink_mission_request_list_message(4, 1, 1), ("MISSION_COUNT", (0, 1))),
        (mavlink.MAVLink_mission_clear_all_message(4, 1, 2), ("MISSION_ACK", (0, 2))),
        (mavlink.MAVLink_mission_count_message(4, 1, 5, 1), ("MISSION_ACK", (3, 1))),
        (long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1), ("COMMAND_ACK", (400, UNSUPPORTED))),
        (long(mavlink.MAV_CMD_REQUEST_MESSAGE, 435), ("COMMAND_ACK", (512, UNSUPPORTED))),
        (long(mavlink.MAV_CMD_REQUEST_MESSAGE, NAN), ("COMMAND_ACK", (512, UNSUPPORTED))),
    ],
)
def test_what_does_not_exist_has_an_empty_answer_at_once(question, answer):
    assert DeskRig().ask(question) == [(3, *answer)]


def test_there_are_no_files():
    opens = bytes([9, 0, 5, 4, 3]).ljust(251, b"\0")
    rig = DeskRig()
    question = mavlink.MAVLink_file_transfer_protocol_message(0, 4, 1, list(opens)).pack(GCS)
    rig.desk.received(GCS.parse_buffer(question)[0], "qgc")
    (_node, answer, _station) = rig.posted[0]
    assert bytes(answer.payload[:13]).hex(" ") == "0a 00 05 81 01 04 00 00 00 00 00 00 0a"


def test_a_message_that_is_asked_for_follows_its_acknowledgement():
    kinds = [kind for _n, kind, _b in DeskRig().ask(long(mavlink.MAV_CMD_REQUEST_MESSAGE, 148))]
    assert kinds == ["COMMAND_ACK", "AUTOPILOT_VERSION"]


@pytest.mark.parametrize(
    "question",
    [
        long(GO_TO, node=9),  # a vehicle that nobody knows
        long(GO_TO, target=100),  # a camera
        mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3),
    ],
)
def test_who_is_not_there_does_not_answer(question):
    assert DeskRig().ask(question) == []


@pytest.fixture
def rig():
    return DeskRig()


def test_an_order_is_in_progress_until_the_drone_has_it(rig):
    assert rig.ask(reposition(NORTH_DEG, 5.0, 15.0)) == [(3, "COMMAND_ACK", (GO_TO, IN_PROGRESS))]
    assert goal_of(rig) == Location(100, 0, 12)
    rig.ordered[-1][2]("")
    assert rig.event("order sent") == []
    assert rig.event("order accepted") == [(3, "COMMAND_ACK", (GO_TO, ACCEPTED))]
    assert rig.event("order arrived") == []


@pytest.mark.parametrize(
    ("end", "result"),
    [
        ("order refused", DENIED),
        ("no route", REJECTED),
        ("order given up", FAILED),
        ("order lost contact", FAILED),
        ("order replaced", CANCELLED),
    ],
)
def test_an_order_ends_as_the_mesh_says(end, result):
    rig = DeskRig()
    rig.ask(reposition(NORTH_DEG, 5.0, 15.0))
    rig.event("order sent")
    assert rig.event(end) == [(3, "COMMAND_ACK", (GO_TO, result))]


def test_an_order_that_the_gateway_refuses_is_denied_with_its_words(rig):
    rig.ask(reposition(NORTH_DEG, 5.0, 15.0))
    rig.ordered[-1][2]("drone 5 is there")
    assert rig.answers() == [
        (3, "COMMAND_ACK", (GO_TO, DENIED)),
        (3, "STATUSTEXT", "not ordered: drone 5 is there"),
    ]


def test_an_order_is_followed_though_the_clock_of_its_gateway_is_a_little_behind(rig):
    rig.ask(reposition(NORTH_DEG, 5.0, 15.0))
    rig.event("order sent", at_s=100.95)
    assert rig.event("order accepted") == [(3, "COMMAND_ACK", (GO_TO, ACCEPTED))]


def test_the_same_command_again_is_the_same_order_and_another_one_replaces_it(rig):
    rig.ask(reposition(NORTH_DEG, 5.0, 15.0))
    assert rig.ask(reposition(NORTH_DEG, 5.0, 15.0))[0][2] == (GO_TO, IN_PROGRESS)
    assert len(rig.ordered) == 1
    results = [brief for _n, _k, brief in rig.ask(reposition(52.0, 5.0, 15.0))]
    assert results == [(GO_TO, CANCELLED), (GO_TO, IN_PROGRESS)]
    assert len(rig.ordered) == 2


@pytest.mark.parametrize(
    ("message", "goal"),
    [
        (reposition(NORTH_DEG, 5.0, 15.0, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT), (100, 0, 15)),
        (long(GO_TO, -1, 1, 0, NAN, NAN, NAN, NAN), HERE),  # how QGroundControl pauses a PX4
        (long(GO_TO, -1, 1, 0, NAN, NAN, NAN, 33.0), (10, 20, 30)),  # and changes its altitude
        (long(mavlink.MAV_CMD_NAV_LOITER_UNLIM), HERE),
        (long(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0), HERE),
        (long(mavlink.MAV_CMD_NAV_LAND), (10, 20, 0)),
        (long(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH), (10, 20, 0)),
        (long(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 6), (10, 20, 0)),
        (mavlink.MAVLink_set_mode_message(4, 129, LAND), (10, 20, 0)),
        (mavlink.MAVLink_set_mode_message(4, 129, RETURN), (10, 20, 0)),
        (mavlink.MAVLink_mission_item_int_message(*GUIDED, *IN_UNITS, 8.0), (100, 0, 8)),
        (mavlink.MAVLink_mission_item_message(*GUIDED, NORTH_DEG, 5.0, 8.0), (100, 0, 8)),
        (target(*IN_UNITS), (100, 0, 8)),
    ],
)
def test_each_way_to_order_leads_to_its_place(rig, message, goal):
    rig.ask(message)
    assert tuple(goal_of(rig)) == pytest.approx(tuple(goal), abs=1)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (reposition(NORTH_DEG, 5.0, 15.0, 10), "heights must be above sea level or above home"),
        (reposition(95.0, 5.0, 15.0), "95, 5 is no place on the earth"),
        (reposition(NORTH_DEG, 5.0, -17.0), "height -20 m is outside 0..500 m"),  # not: to land
        (reposition(NORTH_DEG, 5.0, 3e38), "m is outside 0..500 m"),
        (mavlink.MAVLink_set_mode_message(4, 129, 0x04040000), "only Hold, Return and Land"),
        (target(0, 0, mask=0b000111000111), "only places can be targets"),
    ],
)
def test_what_cannot_be_ordered_is_refused_in_words(rig, message, words):
    texts = "".join(brief for _n, kind, brief in rig.ask(message) if kind == "STATUSTEXT")
    assert words in texts
    assert rig.ordered == []


def test_without_permission_nothing_is_ordered():
    rig = DeskRig(may_order=False)
    ack, *texts = rig.ask(reposition(NORTH_DEG, 5.0, 15.0))
    assert ack == (3, "COMMAND_ACK", (GO_TO, DENIED))
    assert "--ground-station-may-order" in "".join(brief for _n, _k, brief in texts)
    assert rig.ordered == []


def test_a_stream_of_targets_is_one_order_and_its_refusal_is_said_once():
    rig, looker = DeskRig(), DeskRig(may_order=False)
    for step in range(10):
        rig.ask(target(520000700 + step // 5 * 100, 50000000))
    assert len(rig.ordered) == 1  # the other place comes within the same second
    assert sum(len(looker.ask(target(*IN_UNITS))) for _ in range(10)) == 2  # one text in two parts


def test_of_a_stream_one_order_a_second_is_taken_though_a_simulation_shows_the_mesh_more_often(rig):
    for step in range(10):
        now_s = 101.0 + 0.2 * step
        rig.fleet.show([drone(0, now_s), drone(3, now_s, flying=True)], now_s)
        rig.ask(target(520000700 + step * 100, 50000000))
    assert len(rig.ordered) == 2


def test_the_mode_is_what_the_drone_does_not_what_was_asked(rig):
    rig.ask(long(mavlink.MAV_CMD_NAV_LAND))
    assert rig.fleet.heartbeat(rig.fleet.alive(3)).custom_mode == HOLD
    rig.event("order sent")
    rig.event("order accepted")
    assert rig.fleet.heartbeat(rig.fleet.alive(3)).custom_mode == LAND
    rig.ordered.append((3, Location(0.0, 0.0, 5.0), None))  # somebody else orders it
    rig.event("order accepted", number=8)
    assert rig.fleet.heartbeat(rig.fleet.alive(3)).custom_mode == HOLD


def test_a_landing_that_is_asked_for_again_is_the_same_though_the_drone_flies_on(rig):
    rig.ask(mavlink.MAVLink_set_mode_message(4, 129, LAND))
    further = HERE._replace(latitude=14.0)
    rig.fleet.show([drone(3, 102.0, flying=True, place=further)], 102.0)
    rig.ask(mavlink.MAVLink_set_mode_message(4, 129, LAND))
    assert len(rig.ordered) == 1


def test_orders_are_limited(rig):
    for step in range(9):
        rig.ask(reposition(52.0 + step * 1e-5, 5.0, 15.0))
    assert len(rig.ordered) == 5
