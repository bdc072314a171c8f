"""A message on its way out: its ticket, the state of its fragments, and how it is cut into them."""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass, field
from typing import Callable, Mapping, NamedTuple

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.packets import Head
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE

TO_ALL = BROADCAST  # destination: every node of the mesh, best effort
TO_GATEWAY = NO_ROUTE  # destination: the sender's current gateway
LIFETIME_S = 240.0  # a repair takes up to two minutes and a flight
MOST_OPEN = 12  # messages on their way at once; at most MOST_BEHIND + 1
MOST_ORDERS = 1 << 15  # messages of a port in one session: a receiver may have missed all but one
NUMBER_SPAN = packets.DONE_BITS  # from the oldest to the newest open message

Seal = Callable[[bytes, bytes], bytes]
"""Turns the place and the payload of a message into the bytes to send."""


class TicketState(enum.Enum):
    """The progress of a message."""

    QUEUED = "queued"  # waiting, completely or in part
    SENT = "sent"  # completely sent; final for an unreliable message
    DELIVERED = "delivered"  # its receiver has it; final
    GIVEN_UP = "given up"  # `reason` says why; final


@dataclass(eq=False)
class Ticket:
    """One message under way. Any thread may read it; the component's thread changes it."""

    number: int  # counts the messages of this node, from 1
    to: int  # as requested: a node, TO_ALL or TO_GATEWAY
    port: int
    size: int  # bytes
    reliable: bool
    state: TicketState = TicketState.QUEUED
    reason: str = ""  # why it was given up, or what it waits for
    # Called with the ticket when its state changes, in the component's thread; it must not
    # call back into the component.
    changed: Callable[[Ticket], None] | None = None

    def set_state(self, state: TicketState, reason: str = "") -> None:
        if state is not self.state:
            self.state, self.reason = state, reason
            if self.changed is not None:
                self.changed(self)

    @property
    def final(self) -> bool:
        """Whether the state is final."""
        if self.state is TicketState.SENT:
            return not self.reliable
        return self.state is not TicketState.QUEUED

    def __str__(self) -> str:
        words = f"message {self.number} to {destination_in_words(self.to)}: {self.state.value}"
        return f"{words}: {self.reason}" if self.reason else words


def destination_in_words(to: int) -> str:
    return {TO_ALL: "all nodes", TO_GATEWAY: "the gateway"}.get(to, f"node {to}")


@dataclass(eq=False)
class OutgoingMessage:
    """One message under way."""

    ticket: Ticket
    payload: bytes
    expires_s: float
    sealed: bytes = b""  # the bytes to send, once it is under way
    head: Head | None = None  # once it is under way
    to_send: deque[int] = field(default_factory=deque)  # indices of fragments
    whole: bool = False  # whether each fragment has left at least once
    left_s: float = math.inf  # when its last fragment left
    sent: int = 0  # fragments that left, as bits
    known: int = 0  # fragments that the receiver has, as bits
    asked_s: float = math.inf  # since when an answer is awaited
    asks: int = 0  # questions without an answer
    nonce: int = 0  # of the latest POLL; 0: none

    @property
    def in_flight(self) -> int:
        """Fragments that were sent, with unknown outcome."""
        return bin(self.sent & ~self.known).count("1")


class DataPacket(NamedTuple):
    """A packet to send, without its header."""

    kind: int
    body: bytes
    message: OutgoingMessage
    ends_train: bool = False


@dataclass(eq=False)
class Fragmentation:
    """Numbers the messages to one destination, and cuts them into fragments."""

    session: int
    _room: int
    _seal: Seal
    _open: Mapping[int, OutgoingMessage]  # under way, by number, oldest first: of the outbox

    def __post_init__(self) -> None:
        self._number = 0  # of the next message
        self._orders: dict[tuple[int, bool], int] = {}  # next place, by port and reliability

    def may_open(self, ticket: Ticket) -> bool:
        """Whether this message may start: the receiver remembers a bounded number of them."""
        if len(self._open) >= MOST_OPEN:
            return False
        if self._open and (self._number - next(iter(self._open))) & 0xFF >= NUMBER_SPAN:
            return False
        order = self._orders.get((ticket.port, ticket.reliable), 0)
        if order >= MOST_ORDERS:
            return not self._open  # then a new session begins
        return self._behind(ticket, order) <= packets.MOST_BEHIND

    def begin(self, message: OutgoingMessage) -> Head:
        """Number a message, seal it and list its fragments."""
        ticket = message.ticket
        key = (ticket.port, ticket.reliable)
        order = self._orders.get(key, 0)
        if order >= MOST_ORDERS:
            self.session, order = (self.session + 1) & 0xFFFF, 0
            self._orders.clear()
        place = self.session, ticket.port, order
        message.sealed = sealed = self._seal(packets.place_of(*place), message.payload)
        check, size = packets.checksum(*place, sealed), len(sealed)
        head = Head(self._number, *place[:2], size, ticket.reliable, 0, order, check)
        message.head = head
        self._orders[key] = order + 1
        self._number = (self._number + 1) & 0xFF
        message.to_send.extend(range(packets.count_of(size, self._room)))
        return head

    def body(self, message: OutgoingMessage, index: int) -> bytes:
        """The body of a fragment of a message under way."""
        head = message.head
        assert head is not None
        if index == 0:
            head = head._replace(behind=self._behind(message.ticket, head.order))
            return packets.first_body(head, message.sealed, self._room)
        return packets.further_body(head.number, index, message.sealed, self._room)

    def _behind(self, ticket: Ticket, order: int) -> int:
        """The distance from a place in the order of this port back to its oldest open message."""
        heads = (message.head for message in self._open.values() if ticket.reliable)
        same = (head for head in heads if head and head.reliable and head.port == ticket.port)
        return max((order - head.order for head in same), default=0)
