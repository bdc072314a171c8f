"""What each node does to get a packet through, and which nodes it informs if it fails."""

from __future__ import annotations

import random

import pytest
from rig import AlwaysHalf, RecordingAntenna, Rig, RigEngine, packet

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.node.router import MeshnetworkRouter
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError

LOCATION_OF_ORIGIN = "01 01 01 05 05 00 00 00 00 00 00 00 00 00 00 00 00 00 00"
ASK = "05 05 02 01 01"

# Start and stop ------------------------------------------------------------------------------


@pytest.mark.parametrize("gateway", [False, True], ids=["router", "gateway"])
def test_starting_switches_antenna_and_debugging_on_and_introduces_the_node(gateway):
    rig = Rig(node_id=3, gateway=gateway)
    assert rig.antenna.calls == [
        ("start_antenna", rig.mesh),
        ("debugging_mode", rig.mesh, True),
    ]
    rig.antenna.calls.clear()
    rig.mesh.stop()
    assert rig.antenna.calls == [("debugging_mode", rig.mesh, False), ("stop_antenna",)]
    assert rig.mesh.next_tick_s == float("inf")


def test_debugging_is_switched_while_the_node_runs():
    rig = Rig(debug=False)
    assert [call[0] for call in rig.antenna.calls] == ["start_antenna"]
    rig.antenna.calls.clear()
    rig.mesh.switch_debug()
    rig.mesh.switch_debug()
    assert rig.antenna.calls == [
        ("debugging_mode", rig.mesh, True),
        ("debugging_mode", rig.mesh, False),
    ]
    rig.mesh.stop()
    assert rig.antenna.calls[2:] == [("stop_antenna",)]


def test_a_router_introduces_itself_without_a_gateway_and_a_gateway_with_itself():
    for gateway, introduction in ((False, "03 03 03 fe fe ff 00"), (True, "03 03 03 fe fe 00 01")):
        rig = Rig(node_id=3, gateway=gateway)
        rig.mesh.control.search_other_nodes_in_range()
        assert rig.broadcasts() == [packet(introduction)]


@pytest.mark.parametrize("node_id", [-1, 254, 255])
def test_an_invalid_id_is_refused(node_id):
    with pytest.raises(ValueError, match=f"invalid node id {node_id}: must be 0..253"):
        Rig(node_id=node_id)


def test_the_first_check_comes_after_a_random_part_of_the_period_and_then_once_a_period():
    first_checks = set()
    for seed in range(5):
        antenna, rng = RecordingAntenna(), random.Random(seed)
        mesh = MeshnetworkRouter(1, antenna, RigEngine(), ChildTableTree(), rng)
        mesh.start(100.0)
        assert antenna.broadcasts == [packet("01 01 03 fe fe ff")]
        first_s = mesh.next_tick_s
        assert 100.0 <= first_s <= 110.0
        for check in range(3):
            assert mesh.next_tick_s == pytest.approx(first_s + 10.0 * check)
            mesh.tick(mesh.next_tick_s)
            assert len(antenna.broadcasts) == 2 + check
        first_checks.add(first_s)
    assert len(first_checks) == 5


def test_a_late_tick_makes_up_for_one_check_and_not_for_many():
    rig = Rig(timing=MeshTiming(check_period_s=20.0))
    rig.mesh.tick(9.9)
    assert (rig.tried(), rig.broadcasts()) == ([], [])
    rig.mesh.tick(47.0)
    assert len(rig.broadcasts()) == 1
    assert rig.mesh.next_tick_s == 50.0


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"check_period_s": 0.0}, "invalid check_period 0.0: expected seconds"),
        ({"check_period_s": float("nan")}, "invalid check_period nan: expected seconds"),
        ({"connection_lost_after_s": -1.0}, "invalid connection_lost_after -1.0: expected seconds"),
        ({"send_attempts": 0}, "invalid send_attempts 0: expected a whole number, 1..20"),
    ],
)
def test_impossible_timing_is_refused(changes, why):
    with pytest.raises(ConfigurationError, match=why):
        MeshTiming(**changes)


def test_maintaining_introduces_the_node_and_sends_each_child_a_heartbeat():
    rig = Rig(gateway=True)
    rig.know_neighbour(7, 3)
    rig.wait_until(5.0)
    assert rig.broadcasts() == [packet("01 01 03 fe fe 00 01")]
    assert rig.sent() == [packet("01 01 04 03 03 01 01"), packet("01 01 04 07 07 01 01")]


# Sending -------------------------------------------------------------------------------------


def test_a_round_of_heartbeats_tries_three_times_and_then_another_way(rig):
    rig.know_neighbour(2, 3)
    rig.routing.other_can_communicate_with_node(3, 2)
    rig.antenna.gets_lost = lambda payload: payload[2] == 4 and payload[3] == 2
    rig.mesh.control.send_heartbeats([2, 3])
    lost, other_way = packet("01 01 04 02 02 00 ff"), packet("01 01 04 03 02 00 ff")
    heartbeats = rig.tried(4)
    assert heartbeats.count(lost) == 3
    assert heartbeats.count(other_way) == 1
    assert heartbeats.count(packet("01 01 04 03 03 00 ff")) == 1
    assert len(heartbeats) == 5


def test_a_round_of_heartbeats_goes_to_those_behind_others_as_well(rig):
    rig.know_neighbour(3)
    rig.routing.other_can_communicate_with_node(3, 9)
    rig.mesh.control.send_heartbeats([9])
    assert rig.sent(4) == [packet("01 01 04 03 09 00 ff")]


class Obstinate(ChildTableTree):
    """Does not believe others that they cannot reach a node."""

    def other_cant_communicate_with_node(self, other, node):
        return 0


def test_a_technique_that_does_not_forget_a_route_does_not_stop_the_node():
    antenna = RecordingAntenna()
    router = MeshnetworkRouter(1, antenna, RigEngine(), Obstinate(), AlwaysHalf())
    router.start(0.0)
    router.on_msg(packet("00 02 04 01 01 01 00 01"), 0.0)
    router.on_msg(packet("02 02 00 01 fe"), 0.0)
    router.control.send_heartbeat(0)
    for now_s in (1.0, 5.0, 15.0):
        router.tick(now_s)
    assert not router.get_connected_to_gateway()
    assert router.get_route_to_gateway() == 2


def test_a_packet_that_is_taken_counts_as_sent_and_teaches(rig):
    rig.hear(ASK)
    assert rig.sent() == [packet(LOCATION_OF_ORIGIN)]
    assert rig.mesh.get_total_message_sent() == 1
    assert rig.routing.get_direction_to_node(5) == 5


def test_the_routing_technique_learns_what_can_and_what_cannot_be_reached():
    """Any technique is informed of successes and failures; this one has no table."""
    calls = []

    class Told(ChildTableTree):
        def learn(self, creator, from_, kind, payload):
            calls.append(("heard", from_))
            return super().learn(creator, from_, kind, payload)

        def sent(self, neighbour, ok, transmissions):
            calls.append(("took it" if ok else "did not take it", neighbour))
            super().sent(neighbour, ok, transmissions)

        def cant_communicate_with_node(self, node):
            calls.append(("cannot", node))
            return super().cant_communicate_with_node(node)

    antenna = RecordingAntenna()
    mesh = MeshnetworkRouter(1, antenna, RigEngine(), Told(), AlwaysHalf())
    mesh.start(0.0)
    mesh.on_msg(packet(ASK), 0.0)
    assert calls == [("heard", 5), ("took it", 5)]
    antenna.dead = {5}
    mesh.on_msg(packet(ASK), 0.0)
    assert calls[2:] == [("heard", 5), ("did not take it", 5), ("cannot", 5)]


@pytest.mark.parametrize("lost", [1, 2])
def test_a_packet_that_is_lost_is_sent_again_and_costs_no_neighbour(rig, lost):
    rig.antenna.losing = lost
    rig.hear(ASK)
    assert rig.tried() == [packet(LOCATION_OF_ORIGIN)] * (lost + 1)
    assert rig.routing.get_set_of_children() == {5}
    assert rig.mesh.get_total_message_sent() == 1


def test_after_three_failures_the_neighbour_is_lost_and_the_others_are_informed(rig):
    rig.know_neighbour(2, 5, 7)
    rig.antenna.losing = 3
    rig.hear(ASK)
    assert rig.tried(1) == [packet(LOCATION_OF_ORIGIN)] * 3
    assert rig.sent() == [packet("01 01 05 02 02 05"), packet("01 01 05 07 07 05")]
    assert rig.routing.get_set_of_children() == {2, 7}
    assert rig.mesh.get_neighbours().keys() == {2, 7}
    assert rig.kinds()[-2:] == ["NEIGHBOUR_LOST", "NODE_MISSING"]


def test_the_number_of_tries_is_adjustable():
    rig = Rig(timing=MeshTiming(send_attempts=5))
    rig.antenna.dead = {5}
    rig.hear(ASK)
    assert rig.tried() == [packet(LOCATION_OF_ORIGIN)] * 5


def test_a_lost_neighbour_that_another_one_can_reach_is_not_missing(rig):
    """Its own packet goes on over the next route."""
    rig.hear("05 02 00 01 01")
    rig.antenna.dead = {5}
    rig.hear(ASK)
    assert rig.sent() == [packet("01 01 01 02 05")]
    assert rig.routing.get_direction_to_node(5) == 2


def test_own_packets_try_every_route(rig):
    for child in (2, 3, 4):
        rig.routing.other_can_communicate_with_node(child, 9)
    rig.antenna.gets_lost = lambda payload: payload[2] == 4 and payload[3] in (2, 3)
    assert rig.mesh.control.send_heartbeat(9)
    assert rig.sent(4) == [packet("01 01 04 04 09 00 ff")]


def test_a_heartbeat_without_a_route_is_false_and_sends_nothing(rig):
    rig.know_neighbour(2)
    assert not rig.mesh.control.send_heartbeat(9)
    assert rig.tried() == []


def test_a_heartbeat_without_an_acknowledgement_is_false(rig):
    rig.routing.other_can_communicate_with_node(2, 9)
    rig.antenna.dead = {2}
    assert not rig.mesh.control.send_heartbeat(9)
    assert rig.routing.empty()


def test_a_neighbour_that_cannot_be_informed_is_lost_and_the_rest_learn_of_both(rig):
    rig.know_neighbour(2, 3, 5)
    rig.antenna.dead = {2, 5}
    rig.hear(ASK)
    assert rig.sent() == [packet("01 01 05 03 03 05"), packet("01 01 05 03 03 02")]
    assert rig.routing.get_set_of_children() == {3}


def test_losing_two_hundred_neighbours_at_once_is_survived():
    rig = Rig(node_id=253)
    for node in range(200):
        rig.routing.can_communicate_with_node(node)
    rig.antenna.dead = set(range(200))
    rig.wait_until(5.0)
    assert rig.routing.empty()


# Missing nodes -------------------------------------------------------------------------------


def test_a_missing_node_is_dropped_and_reported_to_all_but_the_sender(rig):
    rig.know_neighbour(3, 4)
    rig.hear("09 02 00 01 01", "02 02 05 01 01 09")
    assert rig.sent() == [packet("01 01 05 03 03 09"), packet("01 01 05 04 04 09")]
    assert rig.routing.get_direction_to_node(9) == NO_ROUTE
    assert rig.routing.get_set_of_children() == {2, 3, 4}


@pytest.mark.parametrize(
    ("missing", "neighbours", "behind", "next_hop"),
    [
        ("09", (3,), (), NO_ROUTE),  # it was never behind the sender
        ("09", (4,), (2, 3), 3),  # it has another route
        ("09", (9,), (), 9),  # it is a neighbour
        ("01", (3,), (), NO_ROUTE),  # this node
        ("fe", (3,), (), NO_ROUTE),  # no node
    ],
)
def test_a_missing_node_that_is_still_reached_or_never_was_is_not_reported_on(
    rig, missing, neighbours, behind, next_hop
):
    rig.know_neighbour(2, *neighbours)
    for child in behind:
        rig.routing.other_can_communicate_with_node(child, 9)
    rig.hear(f"02 02 05 01 01 {missing}")
    assert rig.sent() == []
    assert rig.routing.get_direction_to_node(9) == next_hop
    assert {2, *neighbours} <= rig.routing.get_set_of_children()


# Location ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("height", "on_the_air"), [(2.6, "03 00"), (40000.0, "ff 7f"), (-40000.0, "00 80")]
)
def test_the_own_location_has_whole_metres_of_height_within_bounds_and_whole_seconds(
    rig, height, on_the_air
):
    rig.engine.place = Location(1.5, -2.0, height)
    rig.wait(1.99)
    rig.hear(ASK)
    assert rig.sent() == [packet(f"01 01 01 05 05 00 00 c0 3f 00 00 00 c0 {on_the_air} 01")]


@pytest.mark.parametrize("place", [None, Location(float("nan"), 0.0, 0.0)])
def test_a_drone_that_does_not_know_its_place_sends_none(rig, place):
    """It does not invent a place."""
    rig.engine.place = place
    rig.hear(ASK)
    assert rig.tried() == []
    rig.engine.place = RigEngine().place
    rig.hear(ASK)
    assert rig.sent() == [packet("01 01 01 05 05")]


def test_an_answer_takes_the_route_of_the_question_with_the_asker_as_addressee(rig):
    rig.hear("09 05 02 01 01")
    assert rig.sent() == [packet("01 01 01 05 09")]


# The medium comes back -----------------------------------------------------------------------


def test_a_node_that_is_switched_on_introduces_itself_soon_and_one_that_is_off_does_not(rig):
    rig.antenna.powered = False
    rig.mesh.on_antenna_power(False, rig.now_s)
    rig.mesh.on_antenna_registered(rig.now_s)
    rig.wait(1.0)
    rig.antenna.powered = True
    assert rig.broadcasts() == []
    rig.mesh.on_antenna_power(True, rig.now_s)
    rig.wait(1.0)
    assert rig.broadcasts() == [packet("01 01 03 fe fe ff")]


def test_after_the_return_of_the_medium_each_node_waits_for_its_own_part_of_a_second(rig):
    rig.mesh.on_antenna_registered(rig.now_s)
    rig.wait(0.69)
    assert rig.broadcasts() == []
    rig.wait(0.02)  # 0.2 s and half a second
    assert rig.broadcasts() == [packet("01 01 03 fe fe ff")]
