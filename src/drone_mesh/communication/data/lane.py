"""Lane: the messages from this node to one destination.

A message is cut into fragments. The receiver of a reliable one reports the fragments that it has in
an ACK: when the message is complete, when its last fragment arrived but others are missing, and in
answer to a POLL. Missing fragments are then sent again. The sender sends a POLL when no ACK arrives
in time, and when the window is full; behind relays on a shared channel the train takes the place of
the window (see Train), also for messages that are not reliable.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Callable, Iterator

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import LIFETIME_S, DataPacket, OutgoingMessage
from drone_mesh.communication.data.packets import COMPLETE, NO_ANSWER, Ack, Head, Poll
from drone_mesh.communication.data.round_trip import RoundTrip
from drone_mesh.communication.data.ticket import Ticket, TicketState, destination_in_words
from drone_mesh.communication.data.train import Train

FIRST_WINDOW = 32  # our choice, in fragments: less than a message of 1,024 bytes
LEAST_WINDOW = 4
MOST_WINDOW = 256  # our choice: six messages of 1,024 bytes
MOST_OPEN = 12  # messages on their way at once; at most MOST_BEHIND + 1
NUMBER_SPAN = packets.DONE_BITS  # from the oldest to the newest open message

Seal = Callable[[bytes, bytes], bytes]
"""From the place and the payload of a message to the bytes to send."""


def leave_plain(_place: bytes, payload: bytes) -> bytes:
    """For a mesh without a key: the payload itself."""
    return payload


class Lane:
    """The messages from one node to one destination, in the order of submission."""

    def __init__(
        self,
        to: int,
        session: int,
        room: int,
        ended: Callable[[TicketState], None],
        seal: Seal = leave_plain,
        hint: Callable[[], str] = str,
    ) -> None:
        """`room`: bytes of a body; `ended` is called with the last state of each message.

        `hint` returns a possible reason why messages do not arrive.
        """
        self._seal = seal
        self._hint = hint
        self.to = to
        self._ended = ended
        self._session = session
        self._room = room
        self._waiting: deque[OutgoingMessage] = deque()
        self._open: dict[int, OutgoingMessage] = {}  # by number, oldest first
        self._number = 0
        self._orders: dict[tuple[int, bool], int] = {}  # next place, by port and reliability
        self._round_trip = RoundTrip()
        self._window = float(FIRST_WINDOW)
        self._slow_start = True
        self._nonce = 0
        self._train: Train | None = None  # while relays share the channel with this node
        self._latest: OutgoingMessage | None = None  # message whose fragment left last
        self.not_before_s = -math.inf  # no route: time of the next attempt

    def __len__(self) -> int:
        return len(self._waiting) + len(self._open)

    def __iter__(self) -> Iterator[OutgoingMessage]:
        """All messages, oldest first."""
        yield from self._open.values()
        yield from self._waiting

    @property
    def is_idle(self) -> bool:
        """Whether it has nothing to send, now or later."""
        return not len(self) and (self._train is None or not self._train.is_open)

    def add(self, message: OutgoingMessage) -> None:
        """Add a message for this destination."""
        self._waiting.append(message)

    def relayed(self, relayed: bool) -> None:
        """Set whether there are relays on the same channel on the way to the destination."""
        if not relayed:
            self._train = None
        elif self._train is None:
            self._train = Train()

    def next_packet(self, now_s: float) -> DataPacket | None:
        """The next packet to send; call `left` once it was sent."""
        train = self._train
        if train is None:
            return self._timely_poll(now_s) or self._fragment(now_s)
        if train.waits:
            if now_s < self._train_due_s(train):
                return None
            if any(message.in_flight for message in self._open.values()):
                return self._end_of_train()
            train.over(arrived=False)
        poll = self._timely_poll(now_s)
        if poll is not None:
            return poll
        if train.is_full and self._has_more():
            return self._end_of_train()
        return self._fragment(now_s) or self._mark_of_end(train)

    def _timely_poll(self, now_s: float) -> DataPacket | None:
        """A POLL for a message whose ACK is late."""
        for message in self._open.values():
            if message.asks and now_s >= message.asked_s + self._timeout_s(message):
                return self._poll(message)
        return None

    def _fragment(self, now_s: float) -> DataPacket | None:
        """The next fragment; a POLL if the window is full."""
        in_flight, window = 0, math.inf
        if self._train is None:
            in_flight, window = self._in_flight(), self._window
        for message in self._open.values():
            if message.to_send and message.asked_s == math.inf:
                if not message.ticket.reliable or in_flight < window:
                    index = message.to_send[0]
                    return DataPacket(packets.FRAGMENTS[index], self._body(message, index), message)
                if message.in_flight:
                    return self._poll(message)  # what of it arrived?
        if in_flight < window and self._may_open():
            return self._opened(now_s)
        return None

    def _has_more(self) -> bool:
        return self._may_open() or any(message.to_send for message in self._open.values())

    def _in_flight(self) -> int:
        return sum(message.in_flight for message in self._open.values())

    def left(self, packet: DataPacket, now_s: float) -> None:
        """The packet was sent."""
        message = packet.message
        if packet.ends_train:
            assert self._train is not None
            poll = packets.poll_of(packet.body)
            self._train.is_open = False
            if poll.nonce != NO_ANSWER:
                self._train.asked(poll.nonce, now_s)
            return
        if packet.kind == packets.POLL:
            if self._train is not None:
                self._train.is_open = False
            message.asked_s, message.asks = now_s, message.asks + 1
            return
        self._latest = message
        message.ticket.reason = ""
        if self._train is not None:
            self._train.left += 1
            self._train.is_open |= packet.kind != packets.FRAGMENTS.start
        index = message.to_send.popleft()
        message.sent |= 1 << index
        if message.to_send:
            return
        message.whole = True
        if message.ticket.reliable:
            message.asked_s, message.asks = now_s, 1
            if message.ticket.state is TicketState.QUEUED:
                message.ticket.becomes(TicketState.SENT)
        else:
            self._close(message, TicketState.SENT)

    def answered(self, ack: Ack, now_s: float) -> None:
        """Process an ACK of the receiver."""
        if ack.session != self._session:
            return
        complete = {
            number
            for number, message in self._open.items()
            if message.ticket.reliable
            and message.whole
            and (ack.newest - number) & 0xFF < packets.DONE_BITS
            and ack.done >> ((ack.newest - number) & 0xFF) & 1
        }
        message = self._open.get(ack.number)
        if message is not None and ack.has == COMPLETE:
            if message.whole:
                complete.add(ack.number)
        elif message is not None and ack.number not in complete:
            self._partly(message, ack, now_s)
        for number in complete:
            message = self._open[number]
            if message.asks == 1 and (message.nonce == 0 or message.nonce == ack.nonce):
                self._round_trip.measured(now_s - message.asked_s)
            self._grow(message.in_flight)
            self._close(message, TicketState.DELIVERED)
        self._train_answered(ack, now_s)

    def _train_answered(self, ack: Ack, now_s: float) -> None:
        train = self._train
        if train is None:
            return
        arrived = not self._in_flight()
        if train.waits and ack.nonce == train.nonce:
            if train.asks == 1:
                self._round_trip.measured(now_s - train.asked_s)
            train.over(arrived)
            for message in self._open.values():
                if not message.ticket.reliable:
                    message.sent &= message.known  # what is lost is not sent again
        elif arrived and not train.waits:
            train.over(arrived)

    def due_s(self, now_s: float) -> float:
        """When to check this lane next; infinity while nothing waits in it."""
        due_s = math.inf
        if self.is_idle:
            return due_s
        train = self._train
        waits = train is not None and train.waits
        if train is not None and train.waits:
            due_s = self._train_due_s(train)
        for message in self._open.values():
            if message.asked_s < math.inf and not waits:
                due_s = min(due_s, message.asked_s + self._timeout_s(message))
            due_s = min(due_s, message.expires_s)
        if self._waiting:
            due_s = min(due_s, self._waiting[0].expires_s)
        return self.not_before_s if now_s < self.not_before_s else due_s

    def expire(self, now_s: float, has_route: bool) -> None:
        """Give up messages that waited for too long."""
        for message in list(self):
            if now_s >= message.expires_s:
                what = "no acknowledgement from" if has_route else "no route to"
                where = destination_in_words(self.to)
                self.give_up(message, f"{what} {where} for {LIFETIME_S:.0f} s{self._hint()}")

    def give_up(self, message: OutgoingMessage, reason: str) -> None:
        """Stop sending this message."""
        self._close(message, TicketState.GIVEN_UP, reason)

    def hindered(self, reason: str) -> None:
        """Nothing can be sent now: reliable messages wait, the others are given up."""
        if self._train is not None:
            self._train.is_open = False
        for message in list(self):
            if message.ticket.reliable:
                message.ticket.reason = reason
            else:
                self.give_up(message, reason)

    def take(self, to: int) -> list[OutgoingMessage]:
        """Remove the messages addressed to `to`, and return them as if nothing had been sent."""
        messages = [message for message in self if message.ticket.to == to]
        for message in messages:
            self._remove(message)
            message.begin_again()
        if messages:
            self._train = None  # it ended with them
        return messages

    # One message ------------------------------------------------------------------------------

    def _may_open(self) -> bool:
        """Whether the next message may start: the receiver remembers a bounded number of them."""
        if not self._waiting or len(self._open) >= MOST_OPEN:
            return False
        if self._open and (self._number - next(iter(self._open))) & 0xFF >= NUMBER_SPAN:
            return False
        ticket = self._waiting[0].ticket
        order = self._orders.get((ticket.port, ticket.reliable), 0)
        return self._behind(ticket, order) <= packets.MOST_BEHIND

    def _opened(self, now_s: float) -> DataPacket:
        message = self._waiting.popleft()
        ticket, payload = message.ticket, message.payload
        key = (ticket.port, ticket.reliable)
        order = self._orders.get(key, 0)
        message.sealed = self._seal(packets.place_of(self._session, ticket.port, order), payload)
        check = packets.checksum(self._session, ticket.port, order, message.sealed)
        message.head = Head(
            self._number,
            self._session,
            ticket.port,
            len(message.sealed),
            ticket.reliable,
            0,
            order,
            check,
        )
        self._orders[key] = (order + 1) & 0xFFFF
        count = packets.count_of(len(message.sealed), self._room)
        message.to_send.extend(range(count))
        self._open[self._number] = message
        self._number = (self._number + 1) & 0xFF
        return DataPacket(packets.FRAGMENTS[0], self._body(message, 0), message)

    def _behind(self, ticket: Ticket, order: int) -> int:
        """From a place in the order of this port back to its oldest open message."""
        behind = 0
        for message in self._open.values():
            head = message.head
            if ticket.reliable and head is not None and head.reliable and head.port == ticket.port:
                distance = (order - head.order) & 0xFFFF
                behind = max(behind, distance if distance < 1 << 15 else 0)
        return behind

    def _body(self, message: OutgoingMessage, index: int) -> bytes:
        head = message.head
        assert head is not None
        if index == 0:
            head = head._replace(behind=self._behind(message.ticket, head.order))
            return packets.first_body(head, message.sealed, self._room)
        return packets.further_body(head.number, index, message.sealed, self._room)

    def _poll(self, message: OutgoingMessage) -> DataPacket:
        if message.asks >= 2:
            self._window, self._slow_start = float(LEAST_WINDOW), True
            message.ticket.reason = f"no acknowledgement yet{self._hint()}"
        return self._asking(message)

    def _end_of_train(self) -> DataPacket:
        assert self._latest is not None
        return self._asking(self._latest)._replace(ends_train=True)

    def _mark_of_end(self, train: Train) -> DataPacket | None:
        """For the relays, behind a train that is not full."""
        if not train.is_open:
            return None
        assert self._latest is not None
        assert self._latest.head is not None
        poll = Poll(self._session, NO_ANSWER, self._latest.head.number)
        return DataPacket(packets.POLL, packets.poll_body(poll), self._latest, ends_train=True)

    def _asking(self, message: OutgoingMessage) -> DataPacket:
        assert message.head is not None
        self._nonce = self._nonce % 0xFF + 1
        message.nonce = self._nonce
        poll = Poll(self._session, self._nonce, message.head.number)
        return DataPacket(packets.POLL, packets.poll_body(poll), message)

    def _partly(self, message: OutgoingMessage, ack: Ack, now_s: float) -> None:
        if ack.nonce != message.nonce:
            return  # an older answer: a newer one is on its way
        if not message.ticket.reliable:
            message.known = ack.has
            return
        if message.asks == 1:
            self._round_trip.measured(now_s - message.asked_s)
        lost = message.sent & ~ack.has
        self._grow(bin(ack.has & message.sent & ~message.known).count("1"))
        message.known = ack.has
        message.sent &= ack.has
        message.asked_s, message.asks = math.inf, 0
        message.ticket.reason = ""
        if lost:
            self._slow_start = False
            self._window = max(float(LEAST_WINDOW), self._window / 2)
            again = [index for index in range(len(packets.FRAGMENTS)) if lost >> index & 1]
            message.to_send.extendleft(reversed(again))

    def _close(self, message: OutgoingMessage, state: TicketState, reason: str = "") -> None:
        self._remove(message)
        message.ticket.becomes(state, reason)
        self._ended(state)

    def _remove(self, message: OutgoingMessage) -> None:
        if message.head is None:
            self._waiting.remove(message)
        else:
            del self._open[message.head.number]

    # Window and timeout -----------------------------------------------------------------------

    def _grow(self, arrived: int) -> None:
        self._window += arrived if self._slow_start else arrived / self._window * 4
        self._window = min(self._window, float(MOST_WINDOW))

    def _train_due_s(self, train: Train) -> float:
        return train.asked_s + self._round_trip.timeout_s(max(0, train.asks - 1))

    def _timeout_s(self, message: OutgoingMessage) -> float:
        return self._round_trip.timeout_s(max(0, message.asks - 1))
