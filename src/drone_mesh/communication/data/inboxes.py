"""Inboxes: the messages to this node by sender, and whose turn it is to get an ACK."""

from __future__ import annotations

import functools
import math
from collections import OrderedDict
from dataclasses import dataclass
from operator import attrgetter
from typing import Callable, Iterable

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.inbox import Inbox
from drone_mesh.communication.data.outgoing import TO_ALL
from drone_mesh.communication.data.packets import Ack, Poll, SendPacket
from drone_mesh.communication.interfaces import MAX_NODE_ID, IMeshSeals, IWirelessCommunication
from drone_mesh.communication.timing import FAST_HOP_S, Deadlines, Medium

# At 250 kbit/s and per check period of patience: up to 1 s, a first timeout (RFC 6298).
TURN_S = 0.4
TIDY_PERIOD_S = 5.0  # how often old fragments are dropped
MOST_INBOXES = 2 * MAX_NODE_ID  # every other node, with its messages to this one and to all

Deliver = Callable[[int, bool, int, bytes, bool], None]
"""A message is complete: sender, whether it is to all nodes, port, payload, whether reliable."""


class AckTurns:
    """The order of the ACKs of one node: on a busy channel its senders take turns.

    A sender behind relays sends a few messages and waits for an ACK. Many senders congest a channel
    also with one message each, and each sees only its own failures: what they decide alone is
    unstable and unfair. Their receiver sees them all. It answers one of them at a time, in the
    order in which their ACKs became due, and the next one after the messages that this answer
    brought, or, if none come, after a pause. So the ACKs admit senders (receiver-driven transport;
    Montazeri et al., Homa, 2018), and each has the same share, whatever its number of hops.
    """

    def __init__(self, medium: Medium, patience: Callable[[], float]) -> None:
        """`patience`: see IWirelessCommunication; 0 on a quiet channel, where no ACK waits."""
        self._turn_s = TURN_S * (medium.hop_s / FAST_HOP_S)
        self._patience = patience
        self._latest: Inbox | None = None  # acknowledged last
        self._ends_s = -math.inf  # at the latest

    def next_s(self, inboxes: Iterable[Inbox]) -> float:
        """When the next ACK leaves; infinity if none is due."""
        due_s = min([inbox.ack_due_s for inbox in inboxes], default=math.inf)
        if self._latest is None:
            return due_s
        return max(due_s, min(self._ends_s, self._latest.ack_due_s))

    def acknowledge(self, inboxes: Iterable[Inbox], now_s: float) -> None:
        """Send the ACK that has been due for longest."""
        self._latest = min(inboxes, key=attrgetter("ack_due_s"))
        self._latest.acknowledge()
        self._ends_s = now_s + self._turn_s * self._patience()


@dataclass(eq=False)
class Inboxes:
    """The inboxes of one node: one per sender, and another one for its messages to all nodes."""

    _node_id: int
    _antenna: IWirelessCommunication
    _seals: IMeshSeals
    _deadlines: Deadlines
    _room: int  # bytes of a body
    _send_packet: SendPacket
    _deliver: Deliver

    def __post_init__(self) -> None:
        self._inboxes: OrderedDict[tuple[int, bool], Inbox] = OrderedDict()  # last used last
        self._tidy_s = math.inf
        medium = self._antenna.medium
        self._slowness = medium.stretched(1.0)
        self._turns = AckTurns(medium, self._antenna.patience)

    @property
    def due_s(self) -> float:
        """When to call `on_time`; infinity: there is nothing to do."""
        return min(self._tidy_s, self._turns.next_s(self._inboxes.values()))

    def fragment(self, sender: int, to_all: bool, index: int, body: bytes) -> None:
        """Process a fragment. Raises PacketError if it is damaged."""
        now_s = self._deadlines.now_s
        inbox = self._inbox(sender, to_all)
        for head, payload, _fragments in inbox.fragment(index, body, now_s):
            self._deliver(sender, to_all, head.port, payload, head.reliable)
        if self._tidy_s == math.inf and inbox.unfinished:
            self._tidy_s = now_s + TIDY_PERIOD_S
        if inbox.ack_due_s <= now_s:
            self._acknowledge_due(now_s)

    def poll(self, sender: int, poll: Poll) -> None:
        now_s = self._deadlines.now_s
        self._inbox(sender, to_all=False).poll(poll, now_s)
        self._acknowledge_due(now_s)

    def on_time(self) -> None:
        """Send due ACKs, and drop what is too old."""
        now_s = self._deadlines.now_s
        self._acknowledge_due(now_s)
        for (sender, to_all), inbox in list(self._inboxes.items()):
            for head, payload, _fragments in inbox.on_time(now_s):
                self._deliver(sender, to_all, head.port, payload, head.reliable)
        if now_s >= self._tidy_s:
            unfinished = any(inbox.unfinished for inbox in self._inboxes.values())
            self._tidy_s = now_s + TIDY_PERIOD_S if unfinished else math.inf

    def _acknowledge_due(self, now_s: float) -> None:
        while now_s >= self._turns.next_s(self._inboxes.values()):
            self._turns.acknowledge(self._inboxes.values(), now_s)

    def _inbox(self, sender: int, to_all: bool) -> Inbox:
        key = (sender, to_all)
        if key not in self._inboxes:
            while len(self._inboxes) >= MOST_INBOXES:
                self._inboxes.popitem(last=False)
            acknowledge = None if to_all else functools.partial(self._acknowledge, sender)
            receiver = TO_ALL if to_all else self._node_id
            open_message = functools.partial(self._seals.open_message, sender, receiver)
            self._inboxes[key] = Inbox(self._room, acknowledge, open_message, self._slowness)
        self._inboxes.move_to_end(key)
        return self._inboxes[key]

    def _acknowledge(self, sender: int, ack: Ack) -> None:
        body = packets.ack_body(ack)
        tag = self._seals.acknowledgement_tag(self._node_id, sender, body)
        self._send_packet(packets.ACK, sender, body + tag)
