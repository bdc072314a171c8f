"""A router gives its neighbours notice before it takes off by order."""

from __future__ import annotations

import pytest
from rig import Rig, packet

from drone_mesh.communication.timing import QUEUED, Medium
from drone_mesh.drone.location import Location

PRESENT, LOCATION, ORDER_REPLY = 3, 1, 64
ACCEPTED, GIVEN_UP = 1, 4
ORDER = "00 02 06 01 01"  # of gateway 0
TO_Y_1 = "00 00 80 3f 00 00 00 00 00 00"  # latitude 1, longitude 0, height 0
TO_Y_2 = "00 00 00 40 00 00 00 00 00 00"
Y_1, Y_2 = Location(1.0, 0.0, 0.0), Location(2.0, 0.0, 0.0)


@pytest.fixture
def rig():
    """Router 1, connected through 2; it takes off 0.3 s after its announcement."""
    rig = Rig(medium=Medium(policy=QUEUED, takes_off_after_s=0.3))
    rig.connect_through(2)
    return rig


def test_a_router_announces_its_goal_twice_before_it_takes_off(rig):
    """A neighbour at the edge is out of reach soon after, and nobody acknowledges a broadcast."""
    rig.hear(f"{ORDER} {TO_Y_1}")
    rig.wait(0.25)
    told = [sent for sent in rig.broadcasts() if sent[2] != PRESENT]
    goal = packet("01 01 01 fe fe 00 00 80 3f 00 00 00 00 00 00 00 00 00 80")
    assert (told, rig.engine.goals) == ([goal, goal], [])
    rig.wait(0.1)
    assert rig.engine.goals == [Y_1]


def test_where_others_learn_at_once_it_takes_off_at_once():
    rig = Rig()
    rig.connect_through(2)
    rig.hear(f"{ORDER} {TO_Y_1}")
    goal = packet("01 01 01 fe fe 00 00 80 3f 00 00 00 00 00 00 00 00 00 80")
    assert goal in rig.broadcasts()
    assert rig.engine.goals == [Y_1]


GOAL_OUT_OF_REACH = "00 00 20 41 00 00 00 00 00 00"  # latitude 10; the range is 9 m


def test_all_but_the_next_hop_acknowledge_the_goal_and_those_out_of_its_reach_are_then_lost(rig):
    """2 stands at (0, 0), 4 at (8, 0), and where 3 stands is not known."""
    for neighbour, latitude in ((2, "00 00 00 00"), (4, "00 00 00 41")):
        rig.hear(f"{neighbour:02x} {neighbour:02x} 01 01 01 {latitude}")
    rig.know_neighbour(3)
    rig.forget()
    rig.hear(f"{ORDER} {GOAL_OUT_OF_REACH}")
    goal = "00 00 20 41 00 00 00 00 00 00 00 00 00 80"
    assert rig.sent(LOCATION) == [packet(f"01 01 01 {n:02x} fe {goal}") for n in (3, 4)]
    assert {2, 3, 4} <= set(rig.mesh.get_neighbours())
    rig.wait(0.35)
    assert 2 not in rig.mesh.get_neighbours()
    assert {3, 4} <= set(rig.mesh.get_neighbours())


def patient_rig():
    """Router 1, one hop from gateway 0; 2, 3 and 4 have one hop, two hops and an unknown number."""
    rig = Rig(medium=Medium(policy=QUEUED, takes_off_after_s=0.3, takes_off_within_s=2.0))
    rig.hear("00 00 04 01 01 01 00 00")  # a heartbeat of the gateway itself
    rig.hear("02 02 03 01 fe 00 01", "03 03 03 01 fe 02 01")
    rig.know_neighbour(4)
    rig.forget()
    return rig


GOAL_1 = "fe 00 00 80 3f 00 00 00 00 00 00 00 00 00 80"


def told(rig):
    return [sent[3] for sent in rig.sent(LOCATION)]


def test_those_with_fewer_hops_are_not_told_one_by_one_as_it_is_not_their_way_to_the_gateway():
    rig = patient_rig()
    rig.hear(f"{ORDER} {TO_Y_1}")
    assert told(rig) == [3, 4]


def test_it_takes_off_once_those_that_it_may_cut_off_have_acknowledged_its_goal():
    rig = patient_rig()
    rig.hear(f"{ORDER} {TO_Y_1}")
    rig.wait(1.0)
    rig.mesh.on_delivered(packet(f"01 01 01 03 {GOAL_1}"), 1, rig.now_s)
    rig.wait(0.2)
    assert rig.engine.goals == []
    rig.mesh.on_delivered(packet(f"01 01 01 04 {GOAL_1}"), 1, rig.now_s)
    rig.wait(0.06)
    assert rig.engine.goals == [Y_1]


def test_it_takes_off_without_an_acknowledgement_when_its_time_is_up():
    rig = patient_rig()
    rig.hear(f"{ORDER} {TO_Y_1}")
    rig.wait(1.9)
    assert rig.engine.goals == []
    rig.wait(0.2)
    assert rig.engine.goals == [Y_1]


def test_the_goal_of_another_drone_that_it_passed_on_is_no_notice():
    rig = patient_rig()
    rig.hear(f"{ORDER} {TO_Y_1}")
    for neighbour in (3, 4):
        rig.mesh.on_delivered(packet(f"09 01 01 {neighbour:02x} {GOAL_1}"), 1, rig.now_s)
    rig.wait(1.0)
    assert rig.engine.goals == []


def test_an_acknowledged_goal_of_an_order_that_was_replaced_is_no_notice_of_the_new_one():
    rig = patient_rig()
    rig.hear(f"{ORDER} {TO_Y_1} 01 00")
    rig.hear(f"{ORDER} {TO_Y_2} 02 00")
    for neighbour in (3, 4):
        rig.mesh.on_delivered(packet(f"01 01 01 {neighbour:02x} {GOAL_1}"), 1, rig.now_s)
    rig.wait(1.0)
    assert rig.engine.goals == []


def test_a_neighbour_that_did_not_take_the_goal_is_told_again_while_it_is_one():
    rig = patient_rig()
    rig.hear(f"{ORDER} {TO_Y_1}")
    rig.sent()
    lost = packet(f"01 01 01 03 {GOAL_1}")
    rig.mesh.on_undelivered(lost, 15, rig.now_s)
    assert rig.sent(LOCATION) == [lost]
    rig.mesh.on_undelivered(lost, 15, rig.now_s)  # twice in a row: it is lost
    assert rig.sent(LOCATION) == []


def test_another_order_before_the_take_off_gives_notice_anew(rig):
    rig.hear(f"{ORDER} {TO_Y_1} 01 00")
    rig.wait(0.2)
    rig.hear(f"{ORDER} {TO_Y_2} 02 00")
    rig.wait(0.25)
    assert rig.engine.goals == []
    rig.wait(0.1)
    assert rig.engine.goals == [Y_2]


def test_the_same_order_of_another_gateway_does_not_delay_the_take_off(rig):
    rig.hear(f"{ORDER} {TO_Y_1} 01 00")
    rig.wait(0.2)
    rig.hear(f"09 02 06 01 01 {TO_Y_1} 01 00")
    rig.wait(0.15)
    assert rig.engine.goals == [Y_1]


def test_a_drone_that_is_asked_before_its_take_off_answers_with_its_goal(rig):
    rig.hear(f"{ORDER} {TO_Y_1}", "02 02 02 01 01 00 00 00 00 00 00 00 00 01")
    answer = packet("01 01 01 02 02 00 00 80 3f 00 00 00 00 00 00 00 00 00 80")
    assert answer in rig.sent(LOCATION)


def test_a_drone_in_flight_turns_without_notice(rig):
    rig.hear(f"{ORDER} {TO_Y_1}")
    rig.wait(0.4)
    rig.hear(f"{ORDER} {TO_Y_2}")
    assert rig.engine.goals == [Y_1, Y_2]


def test_a_drone_that_cannot_take_off_after_its_notice_gives_its_order_up(rig, caplog):
    rig.hear(f"{ORDER} {TO_Y_1} 07 00")
    rig.engine.grounded = "battery"
    rig.wait(0.4)
    assert rig.engine.goals == []
    replies = [(sent[5], sent[7]) for sent in rig.sent(ORDER_REPLY)]
    assert (replies[0], replies[-1]) == ((7, ACCEPTED), (7, GIVEN_UP))
    assert "order given up: drone 1 cannot fly: battery" in caplog.text


def test_a_router_that_is_stopped_before_its_take_off_does_not_fly_after_its_start(rig):
    rig.hear(f"{ORDER} {TO_Y_1} 07 00")
    rig.mesh.stop()
    rig.mesh.start(rig.now_s)
    rig.wait(1.0)
    assert rig.engine.goals == []


def departure_of_2(rig, *, stood, goal):
    """Node 2 stood at one latitude and announces that it flies to another; the range is 9 m."""
    rig.hear(f"02 02 01 01 01 {stood}", f"02 02 01 01 fe {goal} 00 00 00 00 00 00 00 00 00 80")


def test_a_next_hop_that_flies_far_is_none_even_if_its_goal_is_in_reach(rig):
    """It forgets its routes when it lands."""
    departure_of_2(rig, stood="00 00 00 c0", goal="00 00 00 3f")  # from -2 to 0.5 m
    assert 2 not in rig.mesh.get_neighbours()


def test_a_next_hop_counts_as_flying_far_if_nobody_heard_where_it_stood(rig):
    rig.hear("02 02 01 01 fe 00 00 00 3f 00 00 00 00 00 00 00 00 00 80")
    assert 2 not in rig.mesh.get_neighbours()


def test_a_next_hop_that_landed_unheard_is_left_before_its_next_flight(rig):
    """It flew from 7 to 8 m, and now leaves for 0.5 m."""
    departure_of_2(rig, stood="00 00 e0 40", goal="00 00 00 41")
    rig.connect_through(2)
    rig.wait(10.0)
    assert rig.mesh.get_route_to_gateway() == 2
    rig.hear("02 02 01 01 fe 00 00 00 3f 00 00 00 00 00 00 00 00 00 80")
    assert 2 not in rig.mesh.get_neighbours()


def test_a_next_hop_that_repeats_its_goal_still_comes_from_where_it_stood(rig):
    """It flew from 7 to 8 m: its links hold."""
    departure_of_2(rig, stood="00 00 e0 40", goal="00 00 00 41")
    rig.wait(10.0)
    rig.hear("02 02 01 01 fe 00 00 00 41 00 00 00 00 00 00 00 00 00 80")
    assert rig.mesh.get_route_to_gateway() == 2


def test_nobody_can_announce_the_flight_of_another_node(rig):
    """A captured node could end all links around it."""
    rig.know_neighbour(3)
    rig.hear("02 02 01 01 01 00 00 00 c0", f"02 03 01 01 fe {GOAL_OUT_OF_REACH} 00 00 00 80")
    assert rig.mesh.get_route_to_gateway() == 2


def test_a_next_hop_that_flies_a_short_way_remains_one(rig):
    departure_of_2(rig, stood="00 00 80 bf", goal="00 00 80 3f")  # from -1 to 1 m
    assert rig.mesh.get_route_to_gateway() == 2


def test_a_neighbour_that_is_no_next_hop_remains_one_while_its_goal_is_in_reach(rig):
    rig.know_neighbour(3)
    rig.connect_through(3)
    departure_of_2(rig, stood="00 00 00 c0", goal="00 00 00 3f")
    assert 2 in rig.mesh.get_neighbours()


def test_a_router_does_not_go_back_to_a_next_hop_that_flies_away_while_another_one_has_a_gateway(
    rig,
):
    """The one that leaves still answers, and offers the way that it had."""
    rig.know_neighbour(3)
    rig.hear("03 03 03 01 fe 02 01")  # 3 introduces itself: two hops from its gateway
    departure_of_2(rig, stood="00 00 00 c0", goal="00 00 20 41")
    rig.wait(1.5)
    rig.forget()
    rig.hear("02 02 03 01 fe 01 01", "02 02 04 01 01 01 00 01")
    assert [sent for sent in rig.sent() if sent[3] == 2] == []
    rig.hear("03 03 04 01 01 01 00 02")
    assert rig.mesh.get_route_to_gateway() == 3


def test_a_late_answer_through_a_next_hop_that_flies_away_teaches_no_way_back_to_it(rig):
    """A question before its flight was still under way."""
    rig.know_neighbour(3)
    rig.hear("03 03 03 01 fe 02 01")  # 3 introduces itself: two hops from its gateway
    departure_of_2(rig, stood="00 00 00 c0", goal="00 00 20 41")
    rig.hear("00 03 04 01 01 01 00 02", "00 02 04 01 01 01 00 01")
    assert rig.mesh.get_route_to_gateway() == 3
    rig.wait(10.5)  # by now it has landed
    rig.hear("00 02 04 01 01 01 00 01")
    assert rig.mesh.get_route_to_gateway() == 2


def test_an_answer_through_a_next_hop_that_flies_away_counts_if_no_other_neighbour_has_a_gateway(
    rig,
):
    departure_of_2(rig, stood="00 00 00 c0", goal="00 00 20 41")
    rig.hear("00 02 04 01 01 01 00 01")
    assert rig.mesh.get_route_to_gateway() == 2
