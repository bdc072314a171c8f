"""How many messages an outbox sends, and what it does without answers."""

from __future__ import annotations

import pytest
from data_rig import outbox_to_0, submit

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.communication.data.pacing import (
    FIRST_RELAYED_S,
    FIRST_TIMEOUT_S,
    MOST_TIMEOUT_S,
    RoundTrip,
)


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


@pytest.mark.parametrize(("relayed", "first_s"), [(False, 1.0), (True, 3.0)])
def test_while_a_poll_has_no_answer_nothing_else_is_sent(relayed, first_s):
    """The first one leaves later behind relays on a shared channel, where answers may be late."""
    outbox, _ = outbox_with(3, relayed)
    assert len(send_all(outbox, 0.0)) >= 3
    for number in range(20):
        submit(outbox, 10 + number)
    assert outbox.next_packet(first_s - 0.1).kind != packets.POLL
    polled_s = []
    for tenth in range(round(10 * first_s) + 1, 1000):
        for packet in send_all(outbox, tenth / 10) if polled_s else send_poll(outbox, tenth / 10):
            assert packet.kind == packets.POLL
            polled_s.append(tenth / 10)
    assert polled_s[0] == pytest.approx(first_s, abs=0.11)
    waits = [later - earlier for earlier, later in zip(polled_s, polled_s[1:])]
    doubled = [first_s * factor for factor in (2, 4, 8, 16)]
    assert waits[:4] == pytest.approx([min(wait, MOST_TIMEOUT_S) for wait in doubled], abs=0.11)
    assert all(wait == pytest.approx(MOST_TIMEOUT_S, abs=0.11) for wait in waits[4:])


def send_poll(outbox, now_s):
    """The first POLL: it is due before anything else, and nothing follows it."""
    packet = outbox.next_packet(now_s)
    assert packet.kind == packets.POLL
    outbox.on_sent(packet, now_s)
    assert outbox.next_packet(now_s) is None
    return [packet]


def test_an_answer_that_comes_after_a_poll_lengthens_the_timeout():
    """Otherwise a timeout that is too short on a slow path would never be corrected."""
    outbox, tickets = outbox_with(2, relayed=True)
    sent = send_all(outbox, 0.0)
    send_poll(outbox, FIRST_RELAYED_S + 0.1)
    outbox.answered(ack_of(sent[1], nonce=0), 5.0)
    assert tickets[1].state is TicketState.DELIVERED
    assert outbox._round_trip.timeout_s(0) > 5.0 > FIRST_RELAYED_S


def test_a_node_that_is_connected_again_asks_at_once_what_arrived():
    outbox, _ = outbox_with(1, relayed=False)
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
