"""How many messages an outbox sends, and what it does without answers."""

from __future__ import annotations

import pytest
from data_rig import outbox_to_0, submit

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.communication.data.pacing import FIRST_TIMEOUT_S, MOST_TIMEOUT_S, RoundTrip


def outbox_with(count, relayed):
    outbox = outbox_to_0(relayed=relayed)
    return outbox, [submit(outbox, number) for number in range(count)]


def send_all(outbox, now_s):
    """Everything that may leave now."""
    sent = []
    while True:
        packet = outbox.next_packet(now_s)
        if packet is None:
            return sent
        outbox.on_sent(packet, now_s)
        sent.append(packet)


@pytest.mark.parametrize(
    ("relayed", "answered_s", "most"), [(False, 3.0, 12), (True, 0.5, 12), (True, 3.0, 6)]
)
def test_behind_relays_few_messages_leave_at_once_while_answers_are_late(relayed, answered_s, most):
    outbox, _ = outbox_with(1, relayed)
    (first,) = send_all(outbox, 0.0)
    outbox.answered(ack_of(first, nonce=0), answered_s)
    for number in range(1, 31):
        submit(outbox, number, now_s=answered_s)
    sent = send_all(outbox, answered_s)
    assert [packet.kind for packet in sent] == [packets.FRAGMENTS.start] * most


def ack_of(packet, nonce):
    number = packet.message.head.number
    return packets.Ack(7, nonce, number, packets.COMPLETE, newest=number, done=1)


@pytest.mark.parametrize("relayed", [False, True])
def test_while_a_poll_has_no_answer_nothing_else_is_sent(relayed):
    outbox, _ = outbox_with(3, relayed)
    assert len(send_all(outbox, 0.0)) >= 3
    for number in range(20):
        submit(outbox, 10 + number)
    polled_s = []
    for tenth in range(11, 1000):
        for packet in send_all(outbox, tenth / 10) if tenth > 11 else send_polls(outbox):
            assert packet.kind == packets.POLL
            polled_s.append(tenth / 10)
    waits = [later - earlier for earlier, later in zip(polled_s, polled_s[1:])]
    assert waits[:4] == pytest.approx([2.0, 4.0, 8.0, 16.0], abs=0.11)
    assert all(wait == pytest.approx(MOST_TIMEOUT_S, abs=0.11) for wait in waits[4:])


def send_polls(outbox):
    """The first POLL, at 1.1 s: it is due before anything else."""
    packet = outbox.next_packet(1.1)
    assert packet.kind == packets.POLL
    outbox.on_sent(packet, 1.1)
    assert outbox.next_packet(1.1) is None
    return [packet]


def test_an_answer_that_comes_after_a_poll_lengthens_the_timeout():
    """Otherwise a timeout that is too short on a slow path would never be corrected."""
    outbox, tickets = outbox_with(2, relayed=True)
    sent = send_all(outbox, 0.0)
    send_polls(outbox)
    outbox.answered(ack_of(sent[1], nonce=0), 3.0)
    assert tickets[1].state is TicketState.DELIVERED
    assert outbox._round_trip.timeout_s(0) > 3.0 > FIRST_TIMEOUT_S


def test_a_node_that_is_connected_again_asks_at_once_what_arrived():
    outbox, _ = outbox_with(1, relayed=True)
    send_all(outbox, 0.0)
    for tenth in range(11, 400):
        send_all(outbox, tenth / 10)
    outbox.ask_anew(40.0)
    assert outbox.due_s(40.0) == pytest.approx(40.0 + FIRST_TIMEOUT_S)


def test_the_timeout_is_three_tenths_of_a_second_at_least_and_doubles_without_answers():
    round_trip = RoundTrip()
    for _ in range(30):
        round_trip.measured(0.005)
    assert [round_trip.timeout_s(unanswered) for unanswered in (0, 1, 2)] == [0.3, 0.6, 1.2]
