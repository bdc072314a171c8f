"""What a receiver answers and keeps, and for how long (docs/data.md)."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.flood import MOST_HEADS, Flood
from drone_mesh.communication.data.inbox import MOST_PORTS, Inbox
from drone_mesh.communication.data.ordering import PortOrder
from drone_mesh.communication.data.outgoing import LIFETIME_S
from drone_mesh.communication.data.packets import Head, Poll, Whole
from drone_mesh.communication.timing import Deadlines

ROOM = 27
OLD, NEW = 7, 8  # sessions of the sender


class Receiver:
    """One inbox; `acks`: when an ACK left."""

    def __init__(self):
        self.acks = []
        self.inbox = Inbox(
            ROOM,
            self._acknowledge,
            lambda _place, sealed: sealed,
        )
        self.now_s = 0.0
        self.latest = None

    def _acknowledge(self, ack):
        self.acks.append(round(self.now_s, 3))
        self.latest = ack

    def poll(self, number, now_s, size=4, order=None):
        """The sender asks for a message; returns whether it is complete."""
        self.run(now_s)
        check = packets.checksum(OLD, 5, number if order is None else order, bytes(size))
        self.inbox.poll(Poll(OLD, 1, number, check), now_s)
        self.run(now_s)
        done = self.latest.done >> ((self.latest.newest - number) & 0xFF) & 1
        return (self.latest.has == packets.COMPLETE, bool(done))

    def first(self, number, now_s, session=OLD, size=4, order=None, behind=0, port=5):
        """The first fragment of a message arrives; returns what was delivered."""
        self.run(now_s)
        payload, order = bytes(size), number if order is None else order
        check = packets.checksum(session, port, order, payload)
        head = Head(number, session, port, size, True, behind, order, check)
        body = packets.first_body(head, payload, ROOM)
        return [whole.head.number for whole in self.inbox.fragment(0, body, now_s)]

    def second(self, number, now_s):
        """The second and last fragment of a message of 20 bytes arrives."""
        self.run(now_s)
        body = packets.further_body(number, 1, bytes(20), ROOM)
        return [whole.head.number for whole in self.inbox.fragment(1, body, now_s)]

    def run(self, until_s):
        """Send the ACKs that become due."""
        while self.inbox.ack_due_s <= until_s:
            self.now_s = self.inbox.ack_due_s
            self.inbox.acknowledge()
        self.now_s = until_s


@pytest.fixture
def receiver():
    return Receiver()


def test_an_ack_leaves_after_a_pause_or_after_two_tenths_of_a_second_without_one(receiver):
    for number in range(30):
        receiver.first(number, 0.01 * number)
    receiver.run(1.0)
    assert receiver.acks == [0.2, pytest.approx(0.31)]  # the last message arrived at 0.29


def test_an_ack_is_repeated_unasked_three_times_a_second_at_most(receiver):
    receiver.first(0, 0.0)
    receiver.run(1.0)
    for n in range(100):
        receiver.first(0, 1.0 + 0.01 * n)  # the sender missed the ACK
    receiver.run(3.0)
    assert receiver.acks[1:] == pytest.approx([1.0, 1.3, 1.6, 1.9], abs=0.011)


@pytest.mark.parametrize(("after_s", "delivered"), [(29.0, []), (31.0, [1])])
def test_a_late_packet_of_the_session_before_does_not_bring_that_back_for_30_s(
    receiver, after_s, delivered
):
    receiver.first(0, 0.0, OLD)
    receiver.first(0, 10.0, NEW)
    assert receiver.first(1, 10.0 + after_s, OLD) == delivered


@pytest.mark.parametrize(("after_s", "delivered"), [(59.0, [3]), (61.0, [])])
def test_an_incomplete_message_is_kept_for_a_minute(receiver, after_s, delivered):
    assert receiver.first(3, 0.0, size=20) == []
    receiver.inbox.on_time(after_s)
    assert receiver.second(3, after_s) == delivered


def test_a_number_that_comes_again_belongs_to_a_new_message(receiver):
    assert receiver.first(7, 0.0) == [7]
    assert receiver.first(7, 20.0, order=263) == [7]  # the 256 before were lost
    assert receiver.first(7, 20.1, order=263) == []


@pytest.mark.parametrize(
    ("heard", "after_s", "complete"),
    [([], 10.0, True), ([], 301.0, False), ([100], 10.0, False), ([40], 10.0, True)],
)
def test_a_message_is_complete_for_as_long_as_its_sender_can_ask_for_it(
    receiver, heard, after_s, complete
):
    receiver.first(7, 0.0)
    for number in heard:
        receiver.first(number, 1.0, size=20)  # its second half is lost
    assert receiver.poll(7, after_s) == (complete, complete)


def test_what_was_acknowledged_and_waits_is_delivered_when_its_sender_restarts(receiver):
    receiver.first(0, 0.0)
    assert receiver.first(2, 0.1, behind=1) == []
    assert receiver.first(0, 1.0, session=NEW) == [2, 0]


def test_a_port_on_which_messages_wait_is_not_forgotten_for_others(receiver):
    receiver.first(0, 0.0)
    assert receiver.first(2, 0.1, behind=1) == []
    for port in range(6, 6 + 2 * MOST_PORTS):
        receiver.first(3 + port, 0.2, order=0, port=port)
    assert receiver.first(1, 0.3) == [1, 2]


@pytest.mark.parametrize(("after_s", "is_new"), [(4.0, False), (6.0, True)])
def test_a_flooded_fragment_counts_as_known_for_five_seconds(after_s, is_new):
    repeated = []
    antenna = SimpleNamespace(broadcast_message=repeated.append)
    clock = Deadlines()
    flood = Flood(1, antenna, clock)
    fragment = bytes((2, 2, 128, 254, 254, 9)).ljust(32, b"\0")
    assert flood.repeat(fragment)
    clock.now_s = after_s
    assert flood.repeat(fragment) is is_new
    assert len(repeated) == 1 + is_new


def test_after_a_silence_a_number_is_complete_only_if_it_is_still_that_of_the_same_message(
    receiver,
):
    receiver.first(7, 0.0, size=20)
    assert receiver.second(7, 0.1) == [7]
    receiver.first(8, 0.2)
    assert receiver.second(7, 40.0) == []  # perhaps of another message: the numbers went round
    assert receiver.poll(7, 40.1, size=20, order=263) == (False, False)  # it is
    assert receiver.first(7, 40.2, size=20, order=263) == [7]
    assert receiver.poll(8, 40.3)[0]  # asked for by its checksum
    assert receiver.poll(8, 80.0)[0]
    assert receiver.first(8, 80.1, order=264) == [8]


def flooded(order):
    """The only fragment of message 7 of node 2 to all, `order` places after its first."""
    check = packets.checksum(OLD, 5, order, b"")
    body = packets.first_body(Head(7, OLD, 5, 0, False, 0, order, check), b"", ROOM)
    return (bytes((2, 2, 128, 254, 254)) + body).ljust(32, b"\0")


@pytest.mark.parametrize(("orders", "repeated"), [((7, 263), 2), (tuple(range(9)), MOST_HEADS)])
def test_a_few_messages_under_one_number_are_repeated_once_and_the_others_not_at_all(
    orders, repeated
):
    antenna = SimpleNamespace(broadcast_message=lambda _fragment: None)
    flood = Flood(1, antenna, Deadlines())
    outcomes = [flood.repeat(flooded(order)) for order in orders * 3]
    assert outcomes == [True] * repeated + [False] * (len(outcomes) - repeated)


def test_a_message_waits_for_earlier_ones_for_longer_than_their_sender_tries_and_not_for_ever():
    order = PortOrder()
    for number, behind in ((7, 0), (9, 1)):
        order.add(Whole(Head(0, 0, 0, 1, True, behind, number, 0), b"."), 0.0)
    assert order.overdue(LIFETIME_S + 30.0) == []
    assert [whole.head.order for whole in order.overdue(2.0 * LIFETIME_S)] == [9]
