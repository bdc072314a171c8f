"""A gateway answers heartbeats and brings orders into the mesh."""

from __future__ import annotations

import logging

import pytest
from rig import Rig, packet

from drone_mesh.communication.interfaces import NO_ROUTE, KnownNode
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, PlaceTaken


@pytest.fixture
def rig():
    return Rig(node_id=1, gateway=True)


def test_a_gateway_is_connected_to_itself_from_the_start_and_for_ever(rig):
    rig.hear("09 02 04 01 01 01 09 00")  # another gateway
    rig.wait(100.0)
    rig.mesh.on_antenna_power(False, rig.now_s)
    assert rig.mesh.get_connected_to_gateway()
    assert rig.mesh.get_preferred_gateway() == 1
    assert rig.mesh.get_hops_from_gateway_away() == 0
    assert rig.mesh.get_route_to_gateway() == 1


def test_the_internet_is_connected_at_the_start_and_disconnected_at_the_end(rig):
    assert rig.internet.calls == [("connect", rig.mesh)]
    rig.mesh.stop()
    assert rig.internet.calls[1:] == [("disconnect",)]


def test_a_check_maintains_the_routes_and_does_nothing_else(rig):
    rig.know_neighbour(2)
    rig.wait_until(15.0)
    assert rig.broadcasts() == [packet("01 01 03 fe fe 00 01")] * 2
    assert rig.tried() == [packet("01 01 04 02 02 01 01 00")] * 2


# Answers -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heard", "sent"),
    [
        ("05 02 04 01 01 00 ff 01", "01 01 04 02 05 01 01 00"),  # a router without a gateway
        ("05 02 04 01 01 01 01 01", "01 01 04 02 05 01 01 00"),  # one that prefers this gateway
        ("05 02 04 01 01 01 09 01", "01 01 04 02 05 01 01 00"),  # or another one
        ("09 02 04 01 01 01 09 01", None),  # a gateway
        ("05 05 03 01 fe ff 00", "01 01 04 05 05 01 01 00"),  # introductions
        ("05 05 03 01 fe 03 01", None),
        ("09 09 03 01 fe 00 01", None),
        ("05 02 02 01 01", "01 01 01 02 05"),  # asks where it is
        ("05 05 07 01 01 00 00 80 3f", None),  # a bid: a gateway does not negotiate
        ("05 09 04 01 02 00 ff 03", "05 01 04 02 02 00 ff 04"),  # for another node
    ],
)
def test_a_gateway_answers_those_who_need_one_along_their_route_and_forwards(rig, heard, sent):
    rig.know_neighbour(2)
    rig.hear(heard)
    rig.wait(4.0)
    assert rig.tried() == ([packet(sent)] if sent else [])
    assert rig.engine.goals == []


# Orders --------------------------------------------------------------------------------------


def test_an_order_goes_to_the_next_hop_with_its_number(rig):
    rig.hear("05 02 00 01 01")
    assert rig.mesh.send_goal_request_to_drone(5, 1.5, -2.0, 7, rig.now_s)
    assert rig.sent() == [packet("01 01 06 02 05 00 00 c0 3f 00 00 00 c0 07 00 01 00")]


def test_an_order_goes_over_another_route_when_the_first_does_not_take_it(rig):
    for child in (2, 3):
        rig.routing.other_can_communicate_with_node(child, 5)
    rig.antenna.dead = {2}
    assert rig.mesh.send_goal_request_to_drone(5, 2.0, 0.0, 0, rig.now_s)
    assert rig.sent(6) == [packet("01 01 06 03 05 00 00 00 40 00 00 00 00 00 00 01 00")]


def test_an_order_without_a_route_is_false_and_one_line_names_the_drone(rig, caplog):
    rig.know_neighbour(2)
    caplog.clear()
    with caplog.at_level(logging.INFO):
        assert not rig.mesh.send_goal_request_to_drone(77, 2.0, 0.0, 0, rig.now_s)
    assert [record.getMessage() for record in caplog.records] == [
        "node 1: an order for drone 77 failed: order 1 to x 0.00 m, y 2.00 m, z 0 m: no route "
        "(1 so far)"
    ]
    assert rig.tried() == []
    assert (rig.events[-1].kind.name, rig.events[-1].peer) == ("NO_ROUTE", 77)


# Places of other drones ------------------------------------------------------------------------

NODE_5_AT_0_8 = "05 05 01 01 01 00 00 00 41"  # latitude 8


def order(rig, drone, latitude, allow_shared_place=False):
    return rig.mesh.send_goal_request_to_drone(
        drone, latitude, 0.0, 0, rig.now_s, allow_shared_place
    )


def test_an_order_onto_a_drone_that_stands_there_is_refused_with_the_reason_unless_it_says_so(rig):
    rig.know_neighbour(2, 5)
    rig.hear(NODE_5_AT_0_8)
    with pytest.raises(
        PlaceTaken, match="^drone 5 stands 0.5 m from there; allow_shared_place"
    ) as e:
        order(rig, 2, 8.5)
    assert e.value.drone == 5
    assert rig.sent(6) == []
    assert rig.mesh.get_orders() == []
    assert order(rig, 2, 9.0)
    assert order(rig, 2, 8.5, allow_shared_place=True)
    assert order(rig, 5, 8.5, allow_shared_place=True)


def test_its_own_place_refuses_no_drone_an_order(rig):
    rig.know_neighbour(5)
    rig.hear(NODE_5_AT_0_8)
    assert order(rig, 5, 8.0)


def test_an_order_onto_a_drone_that_is_silent_since_is_refused(rig):
    rig.know_neighbour(2, 5)
    rig.hear(NODE_5_AT_0_8)
    rig.antenna.dead = {5}
    rig.wait(30.0)
    with pytest.raises(PlaceTaken, match="drone 5 was last heard 0.0 m from there"):
        order(rig, 2, 8.0)


def test_the_place_of_the_gateway_itself_is_taken(rig):
    rig.know_neighbour(2)
    with pytest.raises(PlaceTaken, match="drone 1 stands"):
        order(rig, 2, 0.0)


def test_only_the_final_place_of_a_drone_on_its_way_counts(rig):
    rig.know_neighbour(2, 3, 5)
    rig.hear(NODE_5_AT_0_8)
    assert order(rig, 5, 20.0)
    assert order(rig, 2, 8.0)
    with pytest.raises(PlaceTaken, match="drone 5 flies to a place 0.0 m from there"):
        order(rig, 3, 20.0)
    rig.hear("05 05 40 01 01 01 00 03")  # order 1: arrived
    with pytest.raises(PlaceTaken, match="drone 5 stands 0.0 m from there"):
        order(rig, 3, 20.0)


def test_a_drone_that_reports_another_place_has_left_the_first_one(rig):
    rig.know_neighbour(2, 5)
    rig.hear(NODE_5_AT_0_8)
    rig.hear("05 05 02 01 01 00 00 c8 42 00 00 00 00 01 00")  # it asks, from latitude 100
    assert order(rig, 2, 8.0)


def test_an_order_for_its_own_drone_is_flown_and_the_landing_reported(rig):
    rig.know_neighbour(2)
    assert rig.mesh.send_goal_request_to_drone(1, 3.0, 4.0, 5, rig.now_s)
    assert rig.engine.goals == [Location(3.0, 4.0, 5)]
    assert rig.kinds()[-1] == "FLIGHT_ORDERED"
    assert rig.tried() == []
    assert rig.mesh.get_connected_to_gateway()
    rig.engine.place = Location(3.0, 4.0, 5.0)
    rig.wait(1.1)
    assert rig.routing.empty()
    goal = packet("01 01 01 fe fe 00 00 40 40 00 00 80 40 05 00 00 00 00 80")
    assert rig.broadcasts() == [goal, goal, packet("01 01 03 fe fe 00 01")]


@pytest.mark.parametrize(
    ("order", "why"),
    [
        ((254, 0.0, 0.0, 0), "invalid drone id 254: must be 0..253"),
        ((-1, 0.0, 0.0, 0), "invalid drone id -1: must be 0..253"),
        ((5, float("nan"), 0.0, 0), "latitude nan is not a finite number"),
        ((5, 5000.5, 0.0, 0), r"latitude 5000\.5 m is outside -5000\.\.5000 m"),
        ((5, 0.0, -5001.0, 0), r"longitude -5001 m is outside"),
        ((1, 0.0, 0.0, -1), r"height -1 m is outside"),
        ((1, 0.0, 0.0, 2.5), r"invalid height 2\.5 m: must be in whole metres"),
    ],
)
def test_what_is_no_order_is_refused_with_the_reason(rig, order, why):
    rig.know_neighbour(5)
    with pytest.raises(GoalRefused, match=why):
        rig.mesh.send_goal_request_to_drone(*order, rig.now_s)
    assert rig.tried() == []
    assert rig.engine.goals == []


# What it knows -------------------------------------------------------------------------------


def test_a_gateway_learns_all_whose_heartbeats_reach_it_with_their_hops(rig):
    rig.now_s = 2.0
    rig.hear("02 02 04 01 01 00 ff 00", "05 02 04 01 01 00 ff 03", "07 02 00 01 01")
    rig.now_s = 3.0
    rig.hear("03 03 00 01 01")
    assert rig.mesh.get_known_nodes() == [
        KnownNode(2, 2, 1, 2.0),
        KnownNode(3, 3, NO_ROUTE, 3.0),
        KnownNode(5, 2, 4, 2.0),
        KnownNode(7, 2, NO_ROUTE, float("-inf")),
    ]


def test_a_node_that_is_lost_is_still_listed_without_a_route(rig):
    rig.hear("05 05 04 01 01 00 ff 00")
    rig.antenna.dead = {5}
    rig.wait_until(5.0)
    assert rig.mesh.get_known_nodes() == [KnownNode(5, NO_ROUTE, 1, 0.0)]


def test_a_heartbeat_that_counts_more_hops_than_there_are_comes_from_an_unknown_distance(rig):
    rig.hear("05 02 04 01 01 00 ff ff")
    assert rig.mesh.get_known_nodes()[-1] == KnownNode(5, 2, NO_ROUTE, 0.0)


@pytest.mark.parametrize("outcome_and_part", ["63 00", "01 7f"])
def test_a_reply_to_an_order_that_is_none_is_counted(rig, outcome_and_part):
    rig.hear(f"05 02 40 01 01 01 00 {outcome_and_part}")
    assert rig.mesh.complaints.counts == {"dropped an invalid reply to an order": 1}
