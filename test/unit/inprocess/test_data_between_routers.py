"""Users' data from any node to any other: a router sends what it cannot route to its gateway."""

from __future__ import annotations

import itertools
import math
import random

import pytest
import scenarios
from scenarios import placed

from drone_mesh.communication.node.node_configuration import ROUTING_TECHNIQUES
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.wire.messages import is_data
from drone_mesh.inprocess.bounds import SHORTEST_PATH

PORT = 9
KEY = MeshKey(bytes(range(16)))


def send_each(network, pairs, every_s):
    """Send each pair its number, and wait. Returns the delays of those that arrived, by pair."""
    sent_s = {}
    for number, (from_, to) in enumerate(pairs):
        sent_s[number] = network.clock.now_s
        network.send(from_, to, b"%d" % number, PORT)
        network.run_for(every_s)
    network.run_for(10.0)
    return {
        (message.sender, to): message.received_s - sent_s[int(message.payload)]
        for to, messages in network.received.items()
        for message in messages
        if message.port == PORT
    }


def assert_all_arrive(network, within_s, count=None, every_s=0.1):
    """Between `count` random pairs of nodes, or all pairs."""
    pairs = list(itertools.permutations(sorted(network.nodes), 2))
    random.Random(3).shuffle(pairs)
    delays = send_each(network, pairs[:count], every_s)
    assert set(delays) == set(pairs[:count])
    assert max(delays.values()) <= within_s


def between_two_gateways(**options):
    """Each of them knows the routers near it."""
    network = scenarios.between_gateways(5, seed=1, **options)
    assert network.run_until(network.all_connected, within_s=60.0)
    network.run_for(30.0)
    return network


def test_a_message_and_an_echo_pass_through_the_gateway_between_two_routers():
    network = placed([(0.0, 0.0), (-6.0, 0.0), (6.0, 0.0)], seed=1)
    network.run_for(30.0)
    ticket, answers = network.send(1, 2, b"hello"), []
    network.echo(2, 1, answers.append)
    network.run_for(1.0)
    assert str(ticket) == "message 1 to node 2: delivered"
    assert [(answer.node, answer.route) for answer in answers] == [(1, (0,))]


@pytest.mark.parametrize("technique", [*ROUTING_TECHNIQUES, SHORTEST_PATH])
def test_between_25_nodes_at_rest_each_message_arrives_within_a_second(technique):
    network = scenarios.fleet(24, 5, seed=1, routing=technique)
    network.run_for(60.0)
    assert_all_arrive(network, within_s=1.0, count=100)


@pytest.mark.parametrize("technique", ["child_table_tree", "beacon"])
@pytest.mark.parametrize("key", [None, KEY], ids=["plain", "key"])
def test_on_a_shared_channel_within_five_seconds(key, technique):
    network = scenarios.fleet(15, 4, seed=1, radio="shared", key=key, routing=technique)
    network.run_for(60.0)
    assert_all_arrive(network, within_s=5.0, count=60, every_s=0.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nodes", "radio", "technique"),
    [
        (25, "shared", "child_table_tree"),
        (25, "shared", "beacon"),
        (100, "disc", "child_table_tree"),
        (100, "disc", "beacon"),
    ],
)
def test_also_between_more_nodes(nodes, radio, technique):
    network = scenarios.fleet(nodes - 1, math.isqrt(nodes), 2, radio=radio, routing=technique)
    network.run_for(60.0)
    assert_all_arrive(network, 1.0 if radio == "disc" else 5.0, count=100, every_s=0.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("technique", "key", "seed"),
    [("child_table_tree", None, 2), ("beacon", None, 2), ("child_table_tree", KEY, 10)],
)
def test_also_between_a_hundred_nodes_on_a_shared_channel(technique, key, seed):
    """With a key a next hop may not have heard the sender since it chose another way up itself."""
    network = scenarios.fleet(99, 10, seed, radio="shared", routing=technique, key=key)
    network.run_for(120.0)
    pairs = random.Random(3).sample(list(itertools.permutations(sorted(network.nodes), 2)), 300)
    delays = send_each(network, pairs, every_s=0.5)
    assert set(delays) == set(pairs)
    assert max(delays.values()) <= 5.0


@pytest.mark.slow
def test_also_with_a_key_between_64_nodes_with_beacons():
    """Their questions for the gateway's nonce and place do not fill the channel for ever."""
    network = scenarios.fleet(63, 8, 2, radio="shared", routing="beacon", key=KEY)
    network.run_for(60.0)
    assert_all_arrive(network, within_s=5.0, count=60, every_s=0.5)


@pytest.mark.slow
def test_a_burst_of_messages_on_a_shared_channel_is_not_followed_by_questions_that_fill_it():
    """Two a second at random times: if senders ask after a second, 1 in 5 is late from then on."""
    network = scenarios.fleet(99, 10, 1, radio="shared")
    network.run_for(80.0)
    rng, sent_s = random.Random(1), {}
    start_s = network.now_s()
    for at_s in sorted(rng.uniform(0.0, 60.0) for _ in range(120)):
        network.run_for(max(0.0, start_s + at_s - network.now_s()))
        payload = len(sent_s).to_bytes(2, "big")
        sent_s[payload] = network.now_s()
        network.send(*rng.sample(sorted(network.nodes), 2), payload, PORT)
    network.run_for(5.0)
    received = (message for messages in network.received.values() for message in messages)
    delays_s = [m.received_s - sent_s[m.payload] for m in received if m.port == PORT]
    assert sum(delay_s <= 5.0 for delay_s in delays_s) >= 119


@pytest.mark.parametrize("technique", ROUTING_TECHNIQUES)
def test_a_gateway_searches_for_a_node_that_uses_another_gateway(technique):
    within_s = 3.0 if technique == "beacon" else 1.0  # it searches every 0.6 s while a packet waits
    assert_all_arrive(between_two_gateways(routing=technique), within_s)


def test_also_on_a_shared_channel():
    assert_all_arrive(between_two_gateways(radio="shared"), within_s=5.0, every_s=1.0)


def test_what_nobody_knows_ends_at_the_gateway_which_says_so_and_nothing_circulates():
    network = scenarios.line(4)
    network.run_for(60.0)
    receivers = []
    for number, node in network.nodes.items():
        note_data(node.component, number, receivers)
    ticket = network.send(4, 77, b"hello")
    network.run_for(1.0)
    assert receivers[:4] == [3, 2, 1, 0]
    network.run_for(249.0)
    assert str(ticket) == "message 1 to node 77: given up: no route to node 77 for 240 s"
    questions = network.nodes[0].component.complaints.counts["no route to node 77"]
    assert 5 <= questions <= 15
    assert len(receivers) <= 4 * (questions + 4)


def note_data(component, number, receivers):
    """Append `number` to `receivers` for each packet of users' data that the node receives."""
    on_msg = component.on_msg

    def noting(payload, now_s):
        if is_data(payload):
            receivers.append(number)
        on_msg(payload, now_s)

    component.on_msg = noting


def test_a_router_that_its_neighbours_think_elsewhere_is_reached_all_the_same():
    network = scenarios.fleet(24, 5, seed=2)
    network.run_for(60.0)
    for node in network.nodes.values():
        routes = node.component.control.routes
        for child in sorted(routes.get_set_of_children() - {24}):
            if not node.is_gateway:
                routes.other_can_communicate_with_node(child, 24)
    ticket = network.send(20, 24, b"hello")
    network.run_for(5.0)
    assert str(ticket) == "message 1 to node 24: delivered"


def arrives(network, from_, to):
    """Whether a message arrives that is sent once."""
    network.send(from_, to, b"once", PORT, reliable=False)
    network.run_for(4.0)
    return [message.payload for message in network.received.get(to, [])] == [b"once"]


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_what_a_relay_cannot_pass_down_goes_back_to_the_gateway_which_searches_for_its_node(radio):
    network = scenarios.line(4, seed=1, radio=radio)
    network.run_for(60.0)
    for relay, child in ((1, 2), (2, 3)):
        routes = network.nodes[relay].component.control.routes
        routes.other_cant_communicate_with_node(child, 4)
    assert arrives(network, 0, 4)
    assert network.nodes[0].component.get_direction_to(4) == 1


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_what_would_circulate_takes_another_way_and_each_node_of_the_loop_learns(radio):
    places = [(0.0, 0.0), (6.0, 0.0), (12.0, 0.0), (12.0, 6.0), (6.0, 6.0), (-6.0, 0.0)]
    network = placed(places, seed=1, radio=radio)
    network.run_for(60.0)
    loop = {2: 3, 3: 4, 4: 2}
    for node, next_hop in loop.items():
        routes = network.nodes[node].component.control.routes
        for child in routes.get_set_of_children():
            routes.other_cant_communicate_with_node(child, 5)
        routes.other_can_communicate_with_node(next_hop, 5)
    assert arrives(network, 2, 5)
    assert any(network.nodes[a].component.get_direction_to(5) != b for a, b in loop.items())


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_a_gateway_keeps_what_is_sent_once_until_its_search_has_found_the_node(radio):
    network = between_two_gateways(radio=radio)
    assert arrives(network, 2, 6)
