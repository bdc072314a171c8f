"""Fragmentation: numbers the messages to one destination, and cuts them into fragments."""

from __future__ import annotations

from typing import Callable, Mapping

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import OutgoingMessage
from drone_mesh.communication.data.packets import Head
from drone_mesh.communication.data.ticket import Ticket

MOST_OPEN = 12  # messages on their way at once; at most MOST_BEHIND + 1
MOST_ORDERS = 1 << 15  # messages of a port in one session: a receiver may have missed all but one
NUMBER_SPAN = packets.DONE_BITS  # from the oldest to the newest open message

Seal = Callable[[bytes, bytes], bytes]
"""Turns the place and the payload of a message into the bytes to send."""


class Fragmentation:
    """Cuts messages into the fragments that the receiver's Reassembly joins again."""

    def __init__(
        self, session: int, room: int, seal: Seal, open_messages: Mapping[int, OutgoingMessage]
    ) -> None:
        """`open_messages`: those under way by number, oldest first; the outbox keeps them."""
        self.session = session
        self._room = room
        self._seal = seal
        self._open = open_messages
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
        place = packets.place_of(self.session, ticket.port, order)
        message.sealed = self._seal(place, message.payload)
        head = message.head = Head(
            self._number,
            self.session,
            ticket.port,
            len(message.sealed),
            ticket.reliable,
            0,
            order,
            packets.checksum(self.session, ticket.port, order, message.sealed),
        )
        self._orders[key] = order + 1
        self._number = (self._number + 1) & 0xFF
        message.to_send.extend(range(packets.count_of(len(message.sealed), self._room)))
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
        behind = 0
        for message in self._open.values():
            head = message.head
            if ticket.reliable and head is not None and head.reliable and head.port == ticket.port:
                behind = max(behind, order - head.order)
        return behind
