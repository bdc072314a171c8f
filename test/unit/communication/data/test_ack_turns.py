"""On a busy channel, the senders to one node get their ACKs one after the other."""

from __future__ import annotations

import math

import pytest

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.inbox import ACK_DELAY_S, Inbox
from drone_mesh.communication.data.inboxes import TURN_S, AckTurns
from drone_mesh.communication.data.packets import Head, Poll
from drone_mesh.communication.timing import FAST_HOP_S, Medium

ROOM = 27
BUSY = 2.5
SHARED = Medium.for_hop(FAST_HOP_S)


class Receiver:
    """A node with three senders; `acknowledged`: time, sender and number of each ACK."""

    def __init__(self, patience, medium=SHARED):
        self.acknowledged = []
        self.now_s = 0.0
        self.inboxes = [
            Inbox(
                ROOM,
                lambda ack, sender=sender: self.acknowledged.append(
                    (round(self.now_s, 3), sender, ack.number)
                ),
                lambda _place, sealed: sealed,
            )
            for sender in range(3)
        ]
        self.turns = AckTurns(medium, lambda: patience)

    def message(self, sender, number, size=4):
        """Its first fragment arrives."""
        payload = bytes(size)
        head = Head(number, 7, 5, size, True, 0, number, packets.checksum(7, 5, number, payload))
        self.inboxes[sender].fragment(0, packets.first_body(head, payload, ROOM), self.now_s)

    def run(self, until_s):
        """Send what becomes due."""
        while self.turns.next_s(self.inboxes) <= until_s:
            self.now_s = max(self.now_s, self.turns.next_s(self.inboxes))
            self.turns.acknowledge(self.inboxes, self.now_s)
        self.now_s = until_s


def test_on_a_quiet_channel_no_ack_waits_for_another():
    receiver = Receiver(patience=0.0)
    for sender in range(3):
        receiver.message(sender, 0)
    receiver.run(ACK_DELAY_S)
    assert [(at_s, sender) for at_s, sender, _ in receiver.acknowledged] == [
        (ACK_DELAY_S, 0),
        (ACK_DELAY_S, 1),
        (ACK_DELAY_S, 2),
    ]
    assert receiver.turns.next_s(receiver.inboxes) == math.inf


def test_on_a_busy_channel_a_sender_that_has_nothing_more_keeps_its_turn_for_a_while():
    receiver = Receiver(BUSY)
    for sender in range(3):
        receiver.message(sender, 0)
    receiver.run(10.0)
    turn_s = 1.0  # 0.4 s times BUSY
    assert [(at_s, sender) for at_s, sender, _ in receiver.acknowledged] == [
        (ACK_DELAY_S, 0),
        (pytest.approx(ACK_DELAY_S + turn_s), 1),
        (pytest.approx(ACK_DELAY_S + 2 * turn_s), 2),
    ]


def test_a_turn_ends_with_the_messages_that_the_ack_brought_and_the_next_sender_follows():
    receiver = Receiver(BUSY)
    for sender in range(3):
        receiver.message(sender, 0)
    receiver.run(0.1)
    receiver.message(0, 1)  # what its ACK brought
    receiver.run(10.0)
    times = {(sender, number): at_s for at_s, sender, number in receiver.acknowledged}
    assert times[1, 0] == pytest.approx(0.1 + ACK_DELAY_S)
    assert times[2, 0] == pytest.approx(times[1, 0] + TURN_S * BUSY)
    assert times[0, 1] == pytest.approx(times[2, 0] + TURN_S * BUSY)  # due later than those


def test_while_an_ack_waits_further_messages_join_it():
    receiver = Receiver(BUSY)
    receiver.message(0, 0)
    receiver.message(1, 0)
    receiver.run(0.1)
    receiver.message(1, 1)
    receiver.message(1, 2)
    receiver.run(10.0)
    assert [ack[1:] for ack in receiver.acknowledged] == [(0, 0), (1, 2)]


def test_a_poll_waits_for_its_turn_and_the_ack_is_about_what_it_asks():
    receiver = Receiver(BUSY)
    receiver.message(0, 0)
    receiver.run(0.1)
    receiver.message(1, 4)
    receiver.message(1, 5)
    receiver.inboxes[1].poll(Poll(7, 9, 4), receiver.now_s)
    assert len(receiver.acknowledged) == 1
    receiver.run(10.0)
    assert [ack[1:] for ack in receiver.acknowledged] == [(0, 0), (1, 4)]


@pytest.mark.parametrize(("hop_s", "times"), [(0.026, 10), (0.0026, 1), (0.0013, 0.5)])
def test_turns_are_as_long_as_hops_take(hop_s, times):
    receiver = Receiver(BUSY, Medium.for_hop(hop_s))
    receiver.message(0, 0)
    receiver.message(1, 0)
    receiver.run(100.0)
    (first_s, _, _), (second_s, _, _) = receiver.acknowledged
    assert second_s - first_s == pytest.approx(times * TURN_S * BUSY)
