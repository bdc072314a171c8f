"""Seeded faults: kill sequences, packets that would circulate, arbitrary packets."""

from __future__ import annotations

import math
import random
from collections import Counter

import pytest
from air_watch import AirWatch
from scenarios import events, hops_across, line, run_until

from drone_mesh.inprocess import Network

NOTICED_S = 12.0  # each node has looked after its connection once
PATIENCE_S = 400.0  # three steps back, each after a lost connection, a negotiation and a flight


def crooked_line(seed):
    """A gateway and four or five routers, each in reach of one of the last two before it.

    The air of half of them loses packets, that of some others lets them overtake each other.
    """
    rng = random.Random(seed)
    network = Network(
        seed=seed, loss=rng.choice((0.0, 0.0, 0.05, 0.1)), jitter_s=rng.choice((0.0, 0.0, 0.01))
    )
    network.add_gateway(0, 0.0, 0.0)
    places = [(0.0, 0.0)]
    for node in range(1, rng.randint(5, 6)):
        x, y = rng.choice(places[-2:])
        angle, distance_m = rng.uniform(-1.0, 1.0), rng.uniform(5.0, 8.5)
        places.append((x + distance_m * math.cos(angle), y + distance_m * math.sin(angle)))
        network.add_router(node, *places[-1], start_s=rng.choice((0.0, rng.random())))
    return network, rng


def alive(network):
    """Routers that have power."""
    return [n for n, node in network.nodes.items() if node.antenna.powered and not node.is_gateway]


def nowhere_to_fly(network, node):
    """Whether a router knows no place at all and has no node in reach."""
    component = network.nodes[node].component
    return (
        node not in network.shortest_hops()
        and component.get_last_good_known_location_id() == 255
        and component.places.gateway is None
    )


def all_are_safe(network):
    """Each router is connected, in the end, or has nowhere to fly to."""
    return all(network.connected(n) or nowhere_to_fly(network, n) for n in alive(network))


def kill_in_the_middle_of_a_negotiation(network, rng):
    """One that negotiates, or a neighbour of it, within milliseconds of the first bid."""
    since_s = network.clock.now_s
    while network.clock.now_s < since_s + 55.0:
        network.run_for(0.5)
        started = events(network, "NEGOTIATION_STARTED", since_s=since_s)
        if started:
            in_it = {node for _at_s, node, _peer in started}
            for node in tuple(in_it):
                in_it |= network.nodes[node].component.get_neighbours().keys()
            network.power(rng.choice(sorted(in_it & set(alive(network)) or in_it)), False)
            return True
    return False


def survive(seed):
    """One sequence. Returns what happened in it."""
    network, rng = crooked_line(seed)
    watch = AirWatch(network)
    network.run_for(12.0)
    hops = hops_across(network)
    assert run_until(network, network.all_connected, within_s=60.0), f"seed {seed}: start"
    happened = Counter()
    for _kill in range(rng.randint(1, 2)):
        if len(alive(network)) > 1:
            network.power(rng.choice(alive(network)[:2]), False)
        network.run_for(rng.choice((0.0, rng.random())))
    if rng.random() < 0.1:
        network.power(0, False)
        network.run_for(rng.uniform(5.0, 60.0))
        network.power(0, True)
        happened["gateway came back"] += 1
    if rng.random() < 0.7:
        network.run_for(25.0)
        happened["killed in a negotiation"] += kill_in_the_middle_of_a_negotiation(network, rng)
    if rng.random() < 0.1:
        dead = [n for n, node in network.nodes.items() if not node.antenna.powered]
        network.power(rng.choice(dead), True)
        happened["switched on again"] += 1
    network.run_for(NOTICED_S)
    assert run_until(network, lambda: all_are_safe(network), PATIENCE_S, step_s=10.0), (
        f"seed {seed}: {[n for n in alive(network) if not network.connected(n)]} never came back"
    )
    sent_on = watch.most_often_sent_on()
    assert sent_on <= 3 * hops, f"seed {seed}: a packet was sent on {sent_on} times"
    happened["flights"] += len(events(network, "FLIGHT_DECIDED"))
    return happened


@pytest.mark.parametrize(
    "first_seed",
    [0, *(pytest.param(first, marks=pytest.mark.slow) for first in range(100, 1000, 100))],
)
def test_a_hundred_kill_sequences_end_without_a_deadlock_and_without_circling_packets(first_seed):
    """Kills among few nodes, also in the middle of a negotiation, with loss and jitter."""
    happened = sum((survive(seed) for seed in range(first_seed, first_seed + 100)), Counter())
    assert happened["flights"] > 30
    assert happened["killed in a negotiation"] > 15
    assert happened["gateway came back"] > 0
    assert happened["switched on again"] > 0


# Packets that would circulate ----------------------------------------------------------------


def ring():
    """Routers 1, 2, 3 in reach of each other, each of which believes the next to lead to node 9."""
    network = Network()
    for node, (x, y) in enumerate([(0.0, 0.0), (5.0, 0.0), (2.5, 4.0)], start=1):
        network.add_router(node, x, y)
    network.add_router(4, -7.0, 0.0)
    network.run_for(0.1)
    for node, next_node in ((1, 2), (2, 3), (3, 1)):
        network.nodes[node].component.control.routes.other_can_communicate_with_node(next_node, 9)
    return network


def test_a_packet_that_would_circulate_is_stopped_where_it_comes_round():
    network = ring()
    watch = AirWatch(network)
    network.inject(1, bytes((4, 4, 0x41, 1, 9)).ljust(32, b"\0"))
    network.run_for(0.5)
    assert watch.sent_on(0x41) == [(1, 2), (2, 3), (3, 1)]
    network.inject(1, bytes((4, 4, 0x41, 1, 9)).ljust(32, b"\0"))
    network.run_for(0.5)
    assert len(watch.sent_on(0x41)) == 3  # 1 has forgotten the entry


def test_users_data_that_would_circulate_goes_round_and_back_once_and_ends_where_it_came_from():
    network = ring()
    watch = AirWatch(network)
    network.inject(1, bytes((4, 4, 0x80, 1, 9)).ljust(32, b"\0"))
    network.run_for(30.0)
    assert watch.sent_on(0x80) == [(1, 2), (2, 3), (3, 1), (1, 3), (3, 2), (2, 1), (1, 4)]
    network.inject(1, bytes((4, 4, 0x80, 1, 9)).ljust(32, b"\0"))
    network.run_for(30.0)
    assert watch.sent_on(0x80)[7:] == [(1, 4)]  # nobody believes in a way any longer


def test_a_packet_that_comes_back_to_its_creator_is_stopped_there():
    network = ring()
    watch = AirWatch(network)
    network.inject(2, bytes((1, 1, 0x80, 2, 9)).ljust(32, b"\0"))
    network.run_for(0.5)
    assert watch.sent_on(0x80) == [(2, 3), (3, 1)]


def test_a_heartbeat_that_would_circulate_ends():
    network = ring()
    watch = AirWatch(network)
    network.inject(1, bytes((4, 4, 4, 1, 9, 0, 255, 0)).ljust(32, b"\0"))
    network.run_for(5.0)
    assert 3 <= len(watch.sent_on(4)) <= 254
    before = network.air.delivered
    network.run_for(0.5)
    assert network.air.delivered - before < 20


# Arbitrary packets ---------------------------------------------------------------------------


def test_ten_thousand_random_packets_leave_a_network_that_heals():
    network = line(3)
    network.run_for(20.0)
    rng = random.Random(9)
    for number in range(10_000):
        node = rng.choice((0, 1))
        payload = bytearray(rng.getrandbits(256).to_bytes(32, "little"))
        if number % 2:
            payload[0], payload[1], payload[3] = rng.randrange(254), rng.randrange(2, 254), node
            payload[4] = rng.choice((node, 254, rng.randrange(254)))
        if payload[2] != 6:  # orders to move are left out
            network.inject(node, bytes(payload))
        if number % 100 == 0:
            network.run_for(0.1)
    network.run_for(2.0)
    assert run_until(network, network.all_connected, within_s=150.0)
