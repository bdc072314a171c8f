"""Outbox: the messages from this node to one destination.

A message is cut into fragments. The receiver of a reliable one reports the fragments that it has in
an ACK: when the message is complete, when its last fragment arrived but others are missing, and in
answer to a POLL. Missing fragments are then sent again. The sender sends a POLL when no ACK arrives
in time, and when the window is full; while one is unanswered, it sends nothing else. If there are
relays on a shared channel on the way, a train takes the place of the window (see Train), also for
messages that are not reliable.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Callable, Iterator

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import (
    LIFETIME_S,
    DataPacket,
    Fragmentation,
    OutgoingMessage,
    Seal,
    TicketState,
    destination_in_words,
)
from drone_mesh.communication.data.pacing import (
    FIRST_RELAYED_S,
    FIRST_TIMEOUT_S,
    CongestionWindow,
    RoundTrip,
    Train,
)
from drone_mesh.communication.data.packets import COMPLETE, NO_ANSWER, Ack, Poll
from drone_mesh.communication.interfaces import NO_ROUTE

MOST_DOUBLED = 6  # with a search of half a second, to about half a minute


@dataclass(eq=False)
class Outbox:
    """The messages from one node to one destination, in the order of submission."""

    to: int
    _session: int
    _room: int  # bytes of a body
    _ended: Callable[[TicketState], None]  # called with the last state of each message
    _seal: Seal
    _hint: Callable[[], str]  # a possible reason why messages do not arrive

    def __post_init__(self) -> None:
        self.waiting: deque[OutgoingMessage] = deque()  # for their first fragment to leave
        self._open: dict[int, OutgoingMessage] = {}  # under way, by number, oldest first
        self._fragmentation = Fragmentation(self._session, self._room, self._seal, self._open)
        self._window = CongestionWindow()
        self._round_trip = RoundTrip()
        self._train: Train | None = None  # if there are relays
        self._nonce = 0
        self._latest: OutgoingMessage | None = None  # message whose fragment left last
        self._misses = 0  # times that a node had no route to the receiver, since its last answer
        self._search_ends_s = -math.inf  # when it may have been found
        self.not_before_s = -math.inf  # no route: time of the next attempt

    def __iter__(self) -> Iterator[OutgoingMessage]:
        """All messages, oldest first."""
        yield from self._open.values()
        yield from self.waiting

    @property
    def is_idle(self) -> bool:
        """Whether it has nothing to send, now or later."""
        return not (self.waiting or self._open or (self._train and self._train.is_open))

    def set_relayed(self, relayed: bool) -> None:
        """Set whether there are relays on the same channel on the way to the destination."""
        self._round_trip.first_s = FIRST_RELAYED_S if relayed else FIRST_TIMEOUT_S
        if not relayed:
            self._train = None
        elif self._train is None:
            self._train = Train(self._round_trip)

    def next_packet(self, now_s: float) -> DataPacket | None:
        """The next packet to send; call `on_sent` once it was sent."""
        train, opened = self._train, self._open.values()
        if train is not None and train.waits:
            if now_s < train.waits_until_s:
                return None
            if self._in_flight():
                return self._asking(self._latest, ends_train=True)
            train.end(arrived=False)
        # Nothing else is sent while a POLL remains without an answer.
        unanswered = next((message for message in opened if message.asks > 1), None)
        for message in [unanswered] if unanswered else opened:
            if message.asks and now_s >= message.asked_s + self._timeout_s(message):
                if message.asks > 1:
                    self._window.on_silence()
                    message.ticket.reason = f"no acknowledgement yet{self._hint()}"
                return self._asking(message)
        if unanswered:
            return None
        if train is None:
            has_more = self.waiting or any(message.to_send for message in opened)
            return self._fragment(self._in_flight(), self._window.size) if has_more else None
        if train.is_full and (self._may_open() or any(message.to_send for message in opened)):
            return self._asking(self._latest, ends_train=True)
        fragment = self._fragment(0, math.inf)
        if fragment is not None or not train.is_open:
            return fragment
        return _question(self._latest, NO_ANSWER, ends_train=True)  # relays need not wait for more

    def _fragment(self, in_flight: int, window: float) -> DataPacket | None:
        """The next fragment; a POLL if the window is full."""
        for message in self._open.values():
            if message.to_send and message.asked_s == math.inf:
                if not message.ticket.reliable or in_flight < window:
                    return self._first_to_send(message)
                if message.in_flight:
                    return self._asking(message)  # which fragments arrived?
        if in_flight >= window or not self._may_open():
            return None
        message = self.waiting.popleft()
        self._open[self._fragmentation.begin(message).number] = message
        return self._first_to_send(message)

    def _in_flight(self) -> int:
        return sum(message.in_flight for message in self._open.values())

    def on_sent(self, packet: DataPacket, now_s: float) -> None:
        message, train = packet.message, self._train
        if packet.ends_train:
            assert train is not None
            train.end_left(packets.poll_of(packet.body).nonce, now_s)
            return
        if packet.kind == packets.POLL:
            self._interrupted()
            message.asked_s, message.asks = now_s, message.asks + 1
            return
        self._latest = message
        message.ticket.reason = ""
        if train is not None:
            train.fragment_left(packet.kind)
        index = message.to_send.popleft()
        message.sent |= 1 << index
        if message.to_send:
            return
        message.whole = True
        if not message.ticket.reliable:
            self._close(message, TicketState.SENT)
            return
        message.asked_s = message.left_s = now_s
        message.asks = 1
        if message.ticket.state is TicketState.QUEUED:
            message.ticket.set_state(TicketState.SENT)

    def answered(self, ack: Ack, now_s: float) -> None:
        """Process an ACK of the receiver."""
        if ack.session != self._fragmentation.session:
            return
        self._misses = 0
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
            if number == ack.number:
                self._measure(message, ack, now_s)
            self._window.grow(message.in_flight)
            self._close(message, TicketState.DELIVERED)
        train = self._train
        if train is not None and train.answered(ack.nonce, not self._in_flight(), now_s):
            for message in self._open.values():
                if not message.ticket.reliable:
                    message.sent &= message.known  # lost fragments are not sent again

    def due_s(self, now_s: float) -> float:
        """When to check this outbox next; infinity while nothing waits in it."""
        if self.is_idle:
            return math.inf
        if now_s < self.not_before_s:
            return self.not_before_s
        times_s = [message.expires_s for message in self._open.values()]
        times_s += [message.expires_s for message in [*self.waiting][:1]]
        if self._train is not None and self._train.waits:
            times_s.append(self._train.waits_until_s)
        else:
            asked = (message for message in self._open.values() if message.asked_s < math.inf)
            times_s += [message.asked_s + self._timeout_s(message) for message in asked]
        return min(times_s, default=math.inf)

    def expire(self, now_s: float, direction: Callable[[int], int]) -> None:
        """Give up messages that waited for too long; `direction`: the next hop to a node."""
        for message in list(self):
            if now_s >= message.expires_s:
                has_way = direction(self.to) != NO_ROUTE and not self._misses
                what = "no acknowledgement from" if has_way else "no route to"
                where = destination_in_words(self.to)
                reason = f"{what} {where} for {LIFETIME_S:.0f} s{self._hint()}"
                self._close(message, TicketState.GIVEN_UP, reason)

    def missing(self, reason: str, search_s: float, now_s: float) -> None:
        """A node on the way has no route to the receiver, and may search for it for so long.

        The next question follows then; if that is in vain, too, after twice as long, and so on.
        """
        if now_s < self._search_ends_s:
            return
        self._search_ends_s = now_s + search_s * 2 ** min(self._misses, MOST_DOUBLED)
        self._misses += 1
        for message in self:
            message.ticket.reason = reason
            if message.asks:
                asked_s = self._search_ends_s - self._timeout_s(message)
                message.asked_s = min(message.asked_s, asked_s)

    def blocked(self, reason: str) -> None:
        """Nothing can be sent now: reliable messages wait, the others are given up."""
        for message in list(self):
            if not message.ticket.reliable:
                self._close(message, TicketState.GIVEN_UP, reason)
        self.waits_because(reason)

    def waits_because(self, reason: str) -> None:
        """Store the reason why nothing is sent now, for the tickets of the messages."""
        self._interrupted()
        for message in self:
            message.ticket.reason = reason

    def ask_anew(self, now_s: float) -> None:
        """After a reconnection, ask for missing ACKs with the shortest time-out again."""
        for message in self._open.values():
            if message.asks:
                message.asked_s, message.asks = now_s, 1

    def take(self, to: int) -> list[OutgoingMessage]:
        """Remove the messages addressed to `to`, and return them as if nothing had been sent."""
        taken = [message for message in self if message.ticket.to == to]
        for message in taken:
            self._remove(message)
            self._train = None
        return [OutgoingMessage(one.ticket, one.payload, one.expires_s) for one in taken]

    # One message ------------------------------------------------------------------------------

    def _may_open(self) -> bool:
        train = self._train
        if not self.waiting or (train is not None and len(self._open) >= train.most_messages):
            return False
        return self._fragmentation.may_open(self.waiting[0].ticket)

    def _first_to_send(self, message: OutgoingMessage) -> DataPacket:
        index = message.to_send[0]
        body = self._fragmentation.body(message, index)
        return DataPacket(packets.FRAGMENTS[index], body, message)

    def _interrupted(self) -> None:
        """Close the current train, so that relays need not wait for more of it."""
        if self._train is not None:
            self._train.is_open = False

    def _asking(self, message: OutgoingMessage | None, ends_train: bool = False) -> DataPacket:
        assert message is not None
        message.nonce = self._nonce = self._nonce % 0xFF + 1
        return _question(message, message.nonce, ends_train)

    def _partly(self, message: OutgoingMessage, ack: Ack, now_s: float) -> None:
        if ack.nonce != message.nonce:
            return  # an older answer: a newer one is on its way
        if not message.ticket.reliable:
            message.known = ack.has
            return
        self._measure(message, ack, now_s)
        lost = message.sent & ~ack.has
        self._window.grow(bin(ack.has & message.sent & ~message.known).count("1"))
        message.known = ack.has
        message.sent &= ack.has
        message.asked_s, message.asks = math.inf, 0
        message.ticket.reason = ""
        if lost:
            self._window.on_loss()
            again = [index for index in range(len(packets.FRAGMENTS)) if lost >> index & 1]
            message.to_send.extendleft(reversed(again))

    def _measure(self, message: OutgoingMessage, ack: Ack, now_s: float) -> None:
        """Learn the round trip from an answer: to its latest POLL, or to its last fragment.

        The latter may arrive after a POLL; without it, a timeout that is too short would stay so.
        """
        if self._train is not None and ack.nonce == self._train.nonce != 0:
            return  # the train measures itself
        if ack.nonce and ack.nonce == message.nonce:
            self._round_trip.measured(now_s - message.asked_s)
        elif ack.nonce == 0 and message.whole:
            self._round_trip.measured(now_s - message.left_s)

    def _close(self, message: OutgoingMessage, state: TicketState, reason: str = "") -> None:
        self._remove(message)
        message.ticket.set_state(state, reason)
        self._ended(state)

    def _remove(self, message: OutgoingMessage) -> None:
        if message.head is None:
            self.waiting.remove(message)
        else:
            del self._open[message.head.number]

    def _timeout_s(self, message: OutgoingMessage) -> float:
        return self._round_trip.timeout_s(max(0, message.asks - 1))


def _question(message: OutgoingMessage | None, nonce: int, ends_train: bool) -> DataPacket:
    head = None if message is None else message.head
    assert message is not None
    assert head is not None
    poll = Poll(head.session, nonce, head.number, head.checksum)
    return DataPacket(packets.POLL, packets.poll_body(poll), message, ends_train)
