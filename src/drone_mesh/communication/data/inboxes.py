"""Inboxes: the messages to this node, by sender."""

from __future__ import annotations

import functools
import math
from collections import OrderedDict
from typing import Callable

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.ack_turns import AckTurns
from drone_mesh.communication.data.echo import SendPacket
from drone_mesh.communication.data.inbox import Inbox
from drone_mesh.communication.data.packets import Ack, Poll
from drone_mesh.communication.data.reassembly import Whole
from drone_mesh.communication.data.ticket import TO_ALL
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    IMeshSeals,
    IWirelessCommunication,
)
from drone_mesh.communication.timing import Deadlines

TIDY_PERIOD_S = 5.0  # how often old fragments are dropped
MOST_INBOXES = 2 * MAX_NODE_ID  # every other node, with its messages to this one and to all

OnArrived = Callable[[int, bool, Whole], None]
"""A message is complete: its sender, whether it was sent to all nodes, and the message."""


class Inboxes:
    """The inboxes of one node: one per sender, and another one for its messages to all nodes."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        seals: IMeshSeals,
        deadlines: Deadlines,
        room: int,
        send_packet: SendPacket,
        on_arrived: OnArrived,
    ) -> None:
        """`room`: bytes of a body."""
        self._node_id = node_id
        self._medium = antenna.medium
        self._seals = seals
        self._deadlines = deadlines
        self._room = room
        self._send_packet = send_packet
        self._on_arrived = on_arrived
        self._inboxes: OrderedDict[tuple[int, bool], Inbox] = OrderedDict()  # last used last
        self._tidy_s = math.inf
        self._turns = AckTurns(antenna.medium, antenna.patience)

    @property
    def due_s(self) -> float:
        """When to call `on_time`; infinity: there is nothing to do."""
        return min(self._tidy_s, self._turns.next_s(self._inboxes.values()))

    def fragment(self, sender: int, to_all: bool, index: int, body: bytes) -> None:
        """Process a fragment. Raises PacketError if it is damaged."""
        now_s = self._deadlines.now_s
        inbox = self._inbox(sender, to_all)
        for whole in inbox.fragment(index, body, now_s):
            self._on_arrived(sender, to_all, whole)
        if self._tidy_s == math.inf and inbox.unfinished:
            self._tidy_s = now_s + TIDY_PERIOD_S
        if inbox.ack_due_s <= now_s:
            self._acknowledge_due(now_s)

    def poll(self, sender: int, poll: Poll) -> None:
        """Answer the POLL of a sender."""
        now_s = self._deadlines.now_s
        self._inbox(sender, to_all=False).poll(poll, now_s)
        self._acknowledge_due(now_s)

    def on_time(self) -> None:
        """Send due ACKs, and drop what is too old."""
        now_s = self._deadlines.now_s
        self._acknowledge_due(now_s)
        for (sender, to_all), inbox in list(self._inboxes.items()):
            for whole in inbox.on_time(now_s):
                self._on_arrived(sender, to_all, whole)
        if now_s >= self._tidy_s:
            unfinished = any(inbox.unfinished for inbox in self._inboxes.values())
            self._tidy_s = now_s + TIDY_PERIOD_S if unfinished else math.inf

    def _acknowledge_due(self, now_s: float) -> None:
        while now_s >= self._turns.next_s(self._inboxes.values()):
            self._turns.acknowledge(self._inboxes.values(), now_s)

    def _inbox(self, sender: int, to_all: bool) -> Inbox:
        key = (sender, to_all)
        inbox = self._inboxes.get(key)
        if inbox is None:
            while len(self._inboxes) >= MOST_INBOXES:
                self._inboxes.popitem(last=False)
            acknowledge = None if to_all else functools.partial(self._acknowledge, sender)
            receiver = TO_ALL if to_all else self._node_id
            open_message = functools.partial(self._seals.open_message, sender, receiver)
            inbox = Inbox(self._room, acknowledge, open_message, self._medium)
            self._inboxes[key] = inbox
        self._inboxes.move_to_end(key)
        return inbox

    def _acknowledge(self, sender: int, ack: Ack) -> None:
        body = packets.ack_body(ack)
        tag = self._seals.acknowledgement_tag(self._node_id, sender, body)
        self._send_packet(packets.ACK, sender, body + tag)
