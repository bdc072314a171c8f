"""Trains: packets to a node behind relays, on a shared channel."""

from __future__ import annotations

from collections import Counter

import pytest
from data_rig import outbox_to_0, submit

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.pacing import (
    FIRST_LENGTH,
    LEAST_LENGTH,
    MOST_LENGTH,
    RoundTrip,
    Train,
)
from drone_mesh.inprocess import Network


@pytest.fixture
def chain():
    """Gateway 0 and routers 1..3 in a line on one channel; node 3 is three hops away."""
    network = Network(seed=3, radio="shared")
    network.add_gateway(0, 0.0, 0.0)
    for node in (1, 2, 3):
        network.add_router(node, 6.0 * node, 0.0)
    assert network.run_until(network.all_connected, 30.0)
    return network


def left_node(network, node):
    """The types of users' packets that this node hands to its antenna from now on."""
    kinds = []
    antenna = network.nodes[node].antenna
    send = antenna.send_message_to

    def record(payload):
        if payload[0] == node and payload[2] in (*packets.FRAGMENTS, packets.POLL):
            kinds.append(payload[2])
        return send(payload)

    antenna.send_message_to = record
    return kinds


def lengths_of_trains(chain, count, reliable):
    """The fragments in each train, while node 3 sends so many messages of 1,024 bytes."""
    kinds = left_node(chain, 3)
    for _ in range(count):
        chain.send(3, 0, bytes(1024), reliable=reliable)
    assert chain.run_until(lambda: len(chain.received.get(0, [])) == count, 30.0)
    trains = "".join("P" if kind == packets.POLL else "f" for kind in kinds).split("P")
    return [len(train) for train in trains]


@pytest.mark.parametrize("reliable", [True, False])
def test_behind_relays_at_most_one_train_is_sent_without_an_answer(chain, reliable):
    lengths = lengths_of_trains(chain, 4, reliable)
    assert lengths[0] == FIRST_LENGTH
    assert max(lengths) <= MOST_LENGTH
    assert sum(lengths) == 4 * 40


@pytest.mark.parametrize("reliable", [True, False])
def test_each_answered_train_is_followed_by_a_longer_one(chain, reliable):
    lengths = lengths_of_trains(chain, 6, reliable)
    assert lengths[:4] == [FIRST_LENGTH, 2 * FIRST_LENGTH, MOST_LENGTH, 64]


@pytest.mark.parametrize("reliable", [True, False])
def test_relays_are_informed_of_the_end_of_a_short_train_too(chain, reliable):
    kinds = left_node(chain, 3)
    chain.send(3, 0, bytes(199), reliable=reliable)
    assert chain.run_until(lambda: len(chain.received.get(0, [])) == 1, 30.0)
    assert kinds == [*packets.FRAGMENTS[:8], packets.POLL]


def test_a_message_of_one_fragment_is_one_packet(chain):
    kinds = left_node(chain, 3)
    chain.send(3, 0, b"21.5")
    assert chain.run_until(lambda: len(chain.received.get(0, [])) == 1, 30.0)
    assert kinds == [packets.FRAGMENTS[0]]


def test_packets_to_a_neighbour_are_sent_without_waiting(chain):
    kinds = left_node(chain, 1)
    tickets = [chain.send(1, 0, bytes(1024), reliable=False) for _ in range(4)]
    assert chain.run_until(lambda: all(ticket.final for ticket in tickets), 30.0)
    assert packets.POLL not in kinds


def test_a_silent_receiver_does_not_stop_best_effort(chain):
    chain.power(0, False)
    tickets = [chain.send(3, 0, bytes(1024), reliable=False) for _ in range(4)]
    assert chain.run_until(lambda: all(ticket.final for ticket in tickets), 60.0)


def test_a_loss_of_best_effort_shortens_the_next_train_and_not_those_after_it():
    outbox = outbox_to_0(relayed=True)
    for number in (1, 2, 3):
        submit(outbox, number, bytes(1024), reliable=False)
    arrived = Counter()  # by message, as bits

    def length_of_train(lost):
        """Send a train whose last fragment gets lost if `lost`, and answer it."""
        sent = []
        while True:
            packet = outbox.next_packet(0.0)
            outbox.on_sent(packet, 0.0)
            if packet.kind == packets.POLL:
                break
            sent.append((packet.message.head.number, packet.kind - packets.FRAGMENTS.start))
        for number, index in sent[:-1] if lost else sent:
            arrived[number] |= 1 << index
        poll = packets.poll_of(packet.body)
        has = arrived[poll.number]
        outbox.answered(packets.Ack(7, poll.nonce, poll.number, has, newest=0, done=0), 0.1)
        return len(sent)

    assert [length_of_train(lost) for lost in (True, True, False, False)] == [32, 16, 8, 16]


def test_a_train_grows_with_answers_and_is_halved_without():
    train = Train(RoundTrip())
    assert train.length == FIRST_LENGTH
    for longer in (2 * FIRST_LENGTH, MOST_LENGTH, MOST_LENGTH):
        train.left = train.length
        train.end(arrived=True)
        assert train.length == longer
    train.end(arrived=True)  # it was not full: nothing is known of longer ones
    assert train.length == MOST_LENGTH
    train.end(arrived=False)
    assert train.length == MOST_LENGTH // 2
    for _ in range(5):
        train.end(arrived=False)
    assert train.length == LEAST_LENGTH
