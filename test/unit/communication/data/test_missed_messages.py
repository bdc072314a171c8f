"""A receiver that missed any number of messages gets the next one, once and in order."""

from __future__ import annotations

import pytest
from data_rig import ROOM, outbox_to_0, submit

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.inbox import Inbox
from drone_mesh.communication.data.outgoing import LIFETIME_S


class Link:
    """An outbox and the inbox of its receiver, which hears only what it is told to hear."""

    def __init__(self, reliable):
        self.reliable, self.count = reliable, 0
        self.outbox = outbox_to_0(session=0xFFFF)
        self.inbox = Inbox(ROOM, lambda ack: None, lambda _place, sealed: sealed)

    def send(self, heard=True):
        """Send a message with its number; the sender gives it up. Returns what is delivered."""
        payload = self.count.to_bytes(4, "big")
        submit(self.outbox, self.count, payload, self.reliable)
        self.count += 1
        packet = self.outbox.next_packet(0.0)
        self.outbox.on_sent(packet, 0.0)
        if self.reliable:
            self.outbox.expire(LIFETIME_S, direction=lambda to: to)
        if not heard:
            return []
        wholes = self.inbox.fragment(packet.kind - packets.FRAGMENTS.start, packet.body, 0.0)
        return [int.from_bytes(whole.payload, "big") for whole in wholes]


@pytest.mark.parametrize("reliable", [True, False], ids=["reliable", "best effort"])
@pytest.mark.parametrize("missed", [32_767, 32_768, 65_536])
def test_after_any_number_of_missed_messages_the_next_ones_arrive(reliable, missed):
    link = Link(reliable)
    assert link.send() == [0]
    for _ in range(missed):
        link.send(heard=False)
    assert [link.send() for _ in range(3)] == [[missed + 1], [missed + 2], [missed + 3]]


@pytest.mark.parametrize("reliable", [True, False], ids=["reliable", "best effort"])
def test_who_hears_all_of_them_gets_each_once(reliable):
    link = Link(reliable)
    assert all(link.send() == [number] for number in range(33_000))  # past the end of a session


def test_a_new_session_waits_for_the_acknowledgements_of_the_last():
    link = Link(reliable=True)
    for _ in range(32_767):
        link.send(heard=False)
    for number in range(2):
        submit(link.outbox, link.count + number, bytes(4))
    last = link.outbox.next_packet(0.0)
    link.outbox.on_sent(last, 0.0)
    assert link.outbox.next_packet(0.0) is None
    head = last.message.head
    link.outbox.answered(packets.Ack(head.session, 0, head.number, packets.COMPLETE, 0, 0), 0.1)
    following = link.outbox.next_packet(0.1).message.head
    assert (head.session, head.order) == (0xFFFF, 32_767)
    assert (following.session, following.order) == (0, 0)
