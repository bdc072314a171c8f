"""Whole networks with the technique beacon, at rest and in motion."""

from __future__ import annotations

import itertools
import math
import random

import pytest
from scenarios import events, line, placed

from drone_mesh.communication.beacon.packets import Beacon
from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.mobility import Area, Mobility, tracks_of

CHANNEL = {"routing": "beacon", "radio": "shared", "rate": "1M"}


def grid(seed=1, side=4, **kwargs):
    network = Network(seed=seed, **{**CHANNEL, **kwargs})
    network.add_fleet(gateways=1, routers=side * side - 1, gridsize=side, spacing=6.0)
    return network


def moving(seed=1, nodes=20, **kwargs):
    """Random waypoints; a link lives half a minute, a node has ten neighbours."""
    side_m = 9.0 * math.sqrt(math.pi * nodes / 10)
    places = {0: (side_m / 2, side_m / 2, 0.0)}
    for node in range(1, nodes):
        places[node] = (node * 7.3 % side_m, node * 4.1 % side_m, 0.0)
    network = placed([place[:2] for place in places.values()], seed=seed, **{**CHANNEL, **kwargs})
    mobility = Mobility(kind="random_waypoint", speed_m_s=(0.3, 0.3))
    network.fly(tracks_of(mobility, places, [0], Area(0.0, 0.0, side_m, side_m), seed))
    return network


def arrivals(network, seconds):
    """Per second one echo to a drone with a path: the shares answered within 2 s, and served."""
    answered, served, asked, seen, last = 0, 0, 0, 0, 0

    def answer(echo):
        nonlocal answered
        answered += echo.round_trip_s < 2.0

    network.run_for(3.0)
    for _ in range(seconds):
        reachable = network.shortest_hops()
        last = next(n for n in (*range(last + 1, len(network.nodes)), *reachable) if n in reachable)
        if last:
            asked += 1
            network.echo(0, last, answer)
        for other in reachable:
            seen += 1
            served += network.path_to_gateway(other) is not None
        network.run_for(1.0)
    network.run_for(2.0)
    return answered / asked, served / seen


@pytest.mark.parametrize("radio", ["shared", "disc"])
def test_everybody_is_connected_within_two_seconds(radio):
    network = grid(radio=radio, side=5)
    assert network.run_until(network.all_connected, within_s=2.0)


def test_a_hundred_nodes_are_connected_within_three_seconds():
    network = grid(side=10, rate="250k")
    assert network.run_until(network.all_connected, within_s=3.0)


def test_there_are_no_heartbeats_and_no_introductions():
    network = grid(radio="disc")
    kinds = set()
    network.air.carries = lambda payload: bool(kinds.add(payload[2])) or True
    network.run_for(30.0)
    assert kinds <= {MessageType.BEACON, MessageType.PROBE}


def test_beacons_become_rarer_while_nothing_changes():
    network = grid(radio="disc")
    sent = []
    network.nodes[5].antenna.broadcast_message = sent.append
    network.run_for(20.0)
    sent.clear()
    network.run_for(16.0)
    assert 9 <= len(sent) <= 13


def test_beacons_that_collide_in_a_large_mesh_at_rest_lose_few_neighbours():
    network = grid(side=8, rate="250k")
    network.run_for(30.0)
    start_s = network.now_s()
    network.run_for(60.0)
    assert (
        len({node for _at_s, _by, node in events(network, "NEIGHBOUR_LOST", since_s=start_s)}) <= 2
    )


def test_a_drone_that_turns_tells_its_neighbours_at_once():
    network = grid(seed=2, radio="disc")
    network.run_for(20.0)
    sent = []
    network.nodes[5].antenna.broadcast_message = sent.append
    start = network.location(5)
    for step in range(16):
        network.nodes[5].drone.put(start._replace(height=0.15 * step))
        network.run_for(0.1)
    motion = Beacon.from_body(sent[-1][5:], start).motion
    assert motion.velocity[2] == pytest.approx(1.5, abs=0.1)


def test_a_parent_asked_for_a_sign_of_life_sends_a_beacon_for_all_its_children():
    network = grid(side=2, radio="disc")
    sent = []
    broadcast = network.nodes[0].antenna.broadcast_message
    network.nodes[0].antenna.broadcast_message = lambda packet: sent.append(broadcast(packet))
    network.run_for(20.0)
    sent.clear()
    assert network.run_until(lambda: sent, within_s=2.0)
    network.run_for(0.5)
    sent.clear()
    network.inject(0, bytes.fromhex("01 01 2b 00 00").ljust(32, b"\0"))
    network.run_for(0.1)
    assert len(sent) == 1


def test_a_drone_that_others_fly_stays_reachable():
    echoes, served = arrivals(moving(), 30)
    assert echoes >= 0.95
    assert served >= 0.99


def test_drones_at_rest_do_without_links_that_only_fading_makes():
    network = grid(side=5, rate="250k", fading="rayleigh")
    network.run_for(20.0)
    parents = {node: network.path_to_gateway(node) for node in network.nodes}
    lengths = [
        network.location(path[0]).distance_m(network.location(path[1]))
        for path in parents.values()
        if path is not None and len(path) > 1
    ]
    assert len(lengths) == 24
    assert sum(length_m > 9.0 for length_m in lengths) <= 2


def test_it_works_without_positions():
    network = moving(radio="disc")
    for node in network.nodes.values():
        node.component.control._motion._locate = lambda: None
    echoes, served = arrivals(network, 30)
    assert echoes >= 0.8
    assert served >= 0.95


def test_wrong_positions_cost_little():
    network = moving(radio="disc")
    for number, node in network.nodes.items():
        locate, count = node.drone.get_location, itertools.count(number)

        def wrong(locate=locate, count=count):
            """One in ten is 18 m off, the others up to 0.2 m."""
            turn, place = next(count), locate()
            off_m = 18.0 if turn % 10 == 0 else 0.1 * (turn % 5 - 2)
            return place._replace(latitude=place.latitude + off_m)

        node.component.control._motion._locate = wrong
    echoes, served = arrivals(network, 30)
    assert echoes >= 0.9
    assert served >= 0.97


@pytest.mark.parametrize(("believed_m", "repaired_m"), [(-0.3, 0.0), (6.6, 7.0)])
def test_a_repair_ends_at_whole_metres_of_height_and_not_under_the_ground(believed_m, repaired_m):
    """Others hear no other heights in a LOCATION, and altitudes of drones on the ground err."""
    network = line(2, seed=1, routing="beacon")
    for node in (network.nodes[0], network.nodes[1]):
        at = node.drone.get_location()._replace(height=believed_m)
        node.component.control._motion._locate = lambda at=at: at
    network.run_for(30.0)
    network.power(1, False)
    goals = []
    network.nodes[2].drone.set_goal = lambda *goal: goals.append(Location(*goal))
    assert network.run_until(lambda: bool(goals), within_s=60.0)
    assert goals[0].height == repaired_m


def test_with_a_key_beacons_are_sealed_and_everything_arrives():
    network = moving(key=MeshKey(bytes(range(16))))
    echoes, served = arrivals(network, 30)
    assert echoes >= 0.9
    assert served >= 0.97


@pytest.mark.slow
def test_with_a_key_fifty_moving_drones_do_not_fill_a_slow_channel_with_challenges():
    network = moving(nodes=50, rate="250k", key=MeshKey(bytes(range(16))))
    network.run_for(30.0)
    echoes, served = arrivals(network, 30)
    assert echoes >= 0.9
    assert served >= 0.99


def test_with_a_key_orders_are_carried_out_soon_and_much_later_and_after_the_gateway_restarts():
    network = grid(side=4, key=MeshKey(bytes(range(16))))
    assert network.run_until(network.all_connected, within_s=10.0)
    network.run_for(12.0)
    for drone, wait_s in ((15, 0.0), (7, 200.0), (12, 0.0)):
        network.run_for(wait_s)
        if drone == 12:
            network.restart(0)
            network.run_for(75.0)
        here = network.location(drone)
        goal = here._replace(longitude=here.longitude + 1.0)
        network.order(drone, goal.longitude, goal.latitude)
        assert network.run_until(lambda: network.location(drone) == goal, within_s=20.0), drone  # noqa: B023


def test_with_a_key_no_link_seems_to_lose_beacons_although_only_some_carry_a_place():
    network = grid(side=4, radio="disc", rate=None, key=MeshKey(bytes(range(16))))
    network.run_for(60.0)
    routes = [node.component.control.routes for node in network.nodes.values()]
    assert {neighbour.loss for known in routes for neighbour in known.neighbours.values()} == {0.0}


def test_a_stranger_without_the_key_is_no_neighbour_of_those_who_have_it():
    key = MeshKey(bytes(range(16)))
    network = placed(
        [(0.0, 0.0), (6.0, 0.0), (6.0, 5.0)],
        seed=1,
        key=lambda node: None if node == 2 else key,
        **CHANNEL,
    )
    network.run_for(20.0)
    assert network.connected(1)
    assert [2 in network.nodes[node].component.control.routes.neighbours for node in (0, 1)] == [
        False, False,
    ]  # fmt: skip


def test_after_the_death_of_a_relay_the_others_take_another_way_within_three_seconds():
    network = grid(side=4)
    network.run_for(10.0)
    routes = {node: network.path_to_gateway(node) for node in network.nodes}
    relay = max(range(1, 16), key=lambda node: sum(node in path for path in routes.values()))
    network.power(relay, False)
    alive = [node for node in network.nodes if node != relay]

    def all_have_a_path():
        paths = [network.path_to_gateway(node) for node in alive]
        return all(path is not None and relay not in path for path in paths)

    assert network.run_until(all_have_a_path, within_s=3.0)


def test_a_dead_gateway_is_noticed_and_another_one_is_taken():
    network = Network(seed=1, **CHANNEL)
    network.add_gateway(0, 0.0, 0.0)
    network.add_gateway(9, 18.0, 0.0, start_s=2.0)
    for node, x in ((1, 6.0), (2, 12.0)):
        network.add_router(node, x, 0.0)
    network.run_for(5.0)
    assert network.nodes[1].component.get_preferred_gateway() == 0
    network.power(0, False)
    assert network.run_until(
        lambda: network.nodes[1].component.get_preferred_gateway() == 9, within_s=12.0
    )
    assert network.run_until(lambda: network.path_to_gateway(1) == [1, 2, 9], within_s=2.0)


def test_a_router_that_is_cut_off_knows_it_within_four_seconds():
    network = line(1, seed=1, **CHANNEL)
    network.run_for(5.0)
    network.power(0, False)
    assert network.run_until(lambda: not network.connected(1), within_s=4.0)


@pytest.mark.parametrize(
    ("routing", "given_s", "waits_s"),
    [("beacon", 0.0, 10.0), ("beacon", 20.0, 20.0), ("child_table_tree", 0.0, 30.0)],
)
def test_a_router_waits_as_its_technique_says_unless_the_user_sets_it(routing, given_s, waits_s):
    network = line(1, routing=routing, timing=MeshTiming(connection_lost_after_s=given_s))
    assert network.nodes[1].component._timing.connection_lost_after_s == waits_s


def test_an_ordered_flight_does_not_end_the_membership():
    network = grid(side=3, radio="disc")
    network.run_for(10.0)
    network.order(8, 14.0, 10.0)
    connected = []
    while network.nodes[8].drone.path is not None or not connected:
        network.run_for(0.5)
        connected.append(network.connected(8))
    assert len(connected) > 3
    assert all(connected)
    assert [e for e in network.events if e.kind is MeshEventKind.ORDER_ACCEPTED]
    network.run_for(10.0)
    assert [e for e in network.events if e.kind is MeshEventKind.ORDER_ARRIVED]


def test_a_reliable_message_reaches_a_router_and_another_one():
    network = grid(side=4)
    network.run_for(5.0)
    tickets = [network.send(0, 15, b"down" * 40), network.send(3, 12, b"across" * 30)]
    assert network.run_until(
        lambda: all(ticket.state is TicketState.DELIVERED for ticket in tickets), within_s=20.0
    )


def test_a_message_for_a_node_that_nobody_announces_is_searched_for():
    network = grid(side=4, radio="disc")
    network.run_for(10.0)
    for node in network.nodes.values():
        for neighbour in node.component.control.routes.neighbours.values():
            neighbour.announced_s.clear()
    ticket = network.send(0, 15, b"found")
    assert network.run_until(lambda: ticket.state is TicketState.DELIVERED, within_s=3.0)


def test_a_packet_without_a_next_hop_waits_for_two_and_a_half_seconds():
    network = line(2, seed=1, routing="beacon")
    network.run_for(10.0)
    network.power(2, False)
    network.echo(0, 2, lambda _answer: None)
    couriers = [node.component.control._courier for node in network.nodes.values()]
    network.run_for(2.0)
    assert any(courier.holds for courier in couriers)
    network.run_for(1.0)
    assert not any(courier.holds for courier in couriers)


def test_pilots_who_fly_the_fleet_cause_no_repair_flight():
    network = moving(nodes=12, radio="disc")
    network.run_for(300.0)
    assert not [e for e in network.events if e.kind is MeshEventKind.FLIGHT_DECIDED]


def test_each_round_of_a_cut_off_chain_follows_soon_after_the_flight_before():
    """The flight that the others see is no motion, and nobody waits for those who have left."""
    network = line(4, spacing=8.0, seed=2, routing="beacon")
    network.run_for(10.0)
    network.power(1, False)
    network.run_for(5.0)
    assert network.run_until(lambda: all(map(network.connected, (2, 3, 4))), within_s=30.0)


def test_those_who_lost_one_parent_remember_its_place_and_not_that_of_each_other():
    network = line(1, spacing=8.0, seed=1, routing="beacon")
    for node, y in ((2, -3.0), (3, 0.0), (4, 3.0)):
        network.add_router(node, 14.0, y)
    network.run_for(10.0)
    network.power(1, False)
    network.run_for(8.0)
    assert not any(map(network.connected, (2, 3, 4)))
    assert {network.nodes[node].component.places.good_id for node in (2, 3, 4)} == {1}


def test_a_mesh_that_has_just_come_up_knows_the_places_that_a_repair_needs():
    network = placed([(1.0 + 8.0 * node, 2.0) for node in range(8)], seed=1, routing="beacon")
    network.run_for(1.0)
    for node in range(1, 8):
        places = network.nodes[node].component.places
        assert places.gateway == pytest.approx(network.location(0))
        assert places.good == pytest.approx(network.location(node - 1))
    network.power(3, False)
    assert network.run_until(lambda: network.connected(4), within_s=40.0)


def test_in_flight_it_learns_no_place_to_step_back_to():
    """Beside its start it was connected through 1, and flies on from there."""
    network = line(2, seed=1, routing="beacon")
    network.run_for(10.0)
    places = network.nodes[2].component.places
    assert places.good_id == 1
    network.order(2, 12.0, 6.0)
    network.run_for(2.0)
    assert network.connected(2)
    assert places.good_id == 0
    network.run_for(10.0)
    assert places.good_id == 1


def test_a_repair_begins_ten_seconds_after_the_loss():
    network = line(1, spacing=8.0, seed=1, routing="beacon")
    network.run_for(10.0)
    network.power(0, False)
    network.run_for(40.0)
    emergency = next(e for e in network.events if e.kind is MeshEventKind.EMERGENCY)
    lost = next(e for e in network.events if e.kind is MeshEventKind.DISCONNECTED)
    assert 10.0 <= emergency.now_s - lost.now_s <= 12.0


def test_the_first_call_of_a_new_router_is_due_at_its_start_and_not_before():
    network = Network(seed=1, routing="beacon")
    network.add_router(1, 0.0, 0.0, start_s=5.0)
    network.run_for(5.0)
    assert network.nodes[1].component.next_tick_s >= 5.0


@pytest.mark.parametrize("seed", [0, 9, 10])
def test_a_group_between_two_gateways_heals_when_both_relays_die_some_seconds_apart(seed):
    """It passes to the other gateway on news that are old already, and forgets the first one."""
    rng = random.Random(seed)
    network = Network(seed=seed, routing="beacon")
    network.add_gateway(0, 0.0, 0.0)
    network.add_gateway(1, 36.0, 0.0)
    network.add_router(2, 7.0, rng.uniform(-1.0, 1.0))
    network.add_router(3, 29.0, rng.uniform(-1.0, 1.0))
    for node, x in ((4, 14.5), (5, 18.0), (6, 21.5)):
        network.add_router(node, x, rng.uniform(-2.0, 2.0))
    assert network.run_until(network.all_connected, within_s=60.0)
    network.run_for(rng.uniform(30.0, 60.0))
    first, second = (2, 3) if rng.random() < 0.5 else (3, 2)
    network.power(first, False)
    network.run_for(rng.uniform(0.0, 8.0))
    network.power(second, False)
    network.run_for(15.0)
    assert not network.all_connected([4, 5, 6])
    assert network.run_until(lambda: network.all_connected([4, 5, 6]), within_s=60.0)
