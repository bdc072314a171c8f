"""The pause between messages on a shared channel, and what an outbox does without answers."""

from __future__ import annotations

import pytest

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.message_pause import MOST_PAUSE_S, MessagePause
from drone_mesh.communication.data.outbox import Outbox
from drone_mesh.communication.data.outgoing import OutgoingMessage
from drone_mesh.communication.data.round_trip import FIRST_TIMEOUT_S, MOST_TIMEOUT_S
from drone_mesh.communication.data.ticket import Ticket, TicketState

BUSY, QUIET = 2.5, 0.0


def test_on_a_quiet_channel_no_pause_follows_an_answer():
    pace = MessagePause()
    pace.on_answer(0.1, QUIET, 7.0)
    assert pace.until_s < 7.0


def test_the_pause_doubles_with_each_timeout_and_shrinks_with_each_answer():
    pace = MessagePause()
    for expected_s in (1.0, 2.0, 4.0, 8.0):
        pace.on_silence(1.0)
        assert pace.pause_s == expected_s
    pace.on_answer(1.0, QUIET, 100.0)
    assert pace.pause_s == pytest.approx(6.4)
    assert pace.until_s == pytest.approx(106.4)
    pace.on_answer(0.5, QUIET, 100.0)
    assert pace.pause_s == pytest.approx(4.0)  # eight round trips
    for _ in range(30):
        pace.on_answer(0.1, QUIET, 100.0)
    assert pace.pause_s == 0.0


def test_the_pause_is_bounded():
    pace = MessagePause()
    for _ in range(20):
        pace.on_silence(1.0)
    assert pace.pause_s == MOST_PAUSE_S == 30.0


def test_on_a_busy_channel_it_grows_with_each_answer_to_eight_round_trips():
    pace, pauses = MessagePause(), []
    for _ in range(10):
        pace.on_answer(0.2, BUSY, 0.0)
        pauses.append(pace.pause_s)
    assert pauses[:3] == pytest.approx([0.1, 0.25, 0.475])
    assert pauses[-1] == pytest.approx(1.6)
    pace.on_answer(0.2, 1.6, 0.0)  # nearly as busy
    assert pace.pause_s < 1.6


def outbox_with(count, relayed):
    outbox = Outbox(to=0, session=7, room=27, ended=lambda _state: None)
    outbox.set_relayed(relayed)
    tickets = [Ticket(number, to=0, port=5, size=16, reliable=True) for number in range(count)]
    for ticket in tickets:
        outbox.add(OutgoingMessage(ticket, bytes(16), now_s=0.0))
    return outbox, tickets


def send_all(outbox, now_s):
    """Everything that may leave now."""
    sent = []
    while True:
        packet = outbox.next_packet(now_s)
        if packet is None:
            return sent
        outbox.on_sent(packet, now_s)
        sent.append(packet)


def ack_of(packet, nonce):
    number = packet.message.head.number
    return packets.Ack(7, nonce, number, packets.COMPLETE, newest=number, done=1)


@pytest.mark.parametrize("relayed", [False, True])
def test_while_a_poll_has_no_answer_nothing_else_is_sent(relayed):
    outbox, _ = outbox_with(3, relayed)
    assert len(send_all(outbox, 0.0)) >= 3
    for number in range(20):
        ticket = Ticket(10 + number, to=0, port=5, size=16, reliable=True)
        outbox.add(OutgoingMessage(ticket, bytes(16), now_s=0.0))
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
