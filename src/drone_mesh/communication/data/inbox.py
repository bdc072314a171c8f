"""Inbox: the messages from one sender, put together from their fragments."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Callable, NamedTuple, Optional

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.ordering import PortOrder
from drone_mesh.communication.data.packets import COMPLETE, Ack, Head, Poll, Whole

EXPIRES_S = 60.0  # an incomplete message is dropped after this time without fragments
MOST_PARTIAL = 24  # incomplete messages of one sender, which has at most 16 under way
_LIVE = 64  # numbers: older messages are no longer under way
DONE_S = 300.0  # longer than a sender retries (LIFETIME_S of outgoing.py)
SILENCE_S = 5.0  # in less, a sender does not use 192 numbers that all get lost
ACK_DELAY_S = 0.02  # complete messages are acknowledged after a pause of this time
ACK_LATEST_S = 0.2  # or after this time without a pause
ACK_AT = 96  # after this many fragments of complete messages an ACK leaves at once
REPEAT_S = 0.3  # least time between unsolicited repetitions of an ACK
MOST_PORTS = 64  # per sender: the order is kept for the ports used last
FORMER_SESSION_S = 30.0  # longer than a packet can take to arrive


Open = Callable[[bytes, bytes], Optional[bytes]]
"""Turns the place and the sealed bytes of a message into its content; None: not authentic."""


class _Done(NamedTuple):
    """A message that was complete. Its number comes again after 256 messages.

    After a silence of its sender a fragment 0 or a POLL tells whether the numbers still stand.
    """

    head: Head
    since_s: float
    is_certain: bool = True


@dataclass
class _Partial:
    touched_s: float
    head: Head | None = None
    count: int = 0  # of its fragments, once the head is known
    bodies: dict[int, bytes] = field(default_factory=dict)
    has: int = 0  # the fragments that have arrived, as bits


@dataclass(eq=False)
class Reassembly:
    """Reassembles the messages of one sender. Memory: MOST_PARTIAL messages at most."""

    _room: int  # bytes of a body
    _open: Open

    def __post_init__(self) -> None:
        self._partial: OrderedDict[int, _Partial] = OrderedDict()  # by number, oldest first
        self._done: OrderedDict[int, _Done] = OrderedDict()  # the latest complete ones, by number
        self._heard_s = -math.inf

    def add(self, index: int, head: Head | None, body: bytes, now_s: float) -> Whole | None:
        """Add a fragment, the first one with its `head`; returns the message if it is complete.

        Drops a message that is damaged or not authentic.
        """
        number = body[0]
        partial = self._partial.get(number)
        known = None if partial is None else partial.head
        is_other = head and known and known.fingerprint != head.fingerprint
        if partial is None or is_other:  # the number belongs to another message now
            self._partial.pop(number, None)
            while len(self._partial) >= MOST_PARTIAL:
                self._partial.popitem(last=False)
            partial = self._partial[number] = _Partial(now_s)
        partial.touched_s = now_s
        if head is not None:
            partial.head, partial.count = head, packets.count_of(head.length, self._room)
        head, count = partial.head, partial.count
        partial.bodies[index] = body
        partial.has |= 1 << index
        if head is None or partial.has & (1 << count) - 1 != (1 << count) - 1:
            return None
        del self._partial[number]
        bodies = list(map(partial.bodies.__getitem__, range(count)))
        sealed = packets.joined(bodies, head.length, self._room)
        place = head.session, head.port, head.order
        if packets.checksum(*place, sealed) != head.checksum:
            return None
        payload = self._open(packets.place_of(*place), sealed)
        if payload is None or len(payload) > packets.MAX_MESSAGE_BYTES:
            return None
        self._done.pop(number, None)
        self._done[number] = _Done(head, now_s)
        while len(self._done) > _LIVE:
            self._done.popitem(last=False)
        return Whole(head, payload, count)

    def __len__(self) -> int:
        return len(self._partial)

    def is_done(self, number: int, head: Head | None) -> bool:
        """Whether a fragment belongs to a complete message, so that it is a duplicate.

        Call `heard` before.
        """
        done = self._done.get(number)
        if done is None:
            return False
        if head is None:
            return done.is_certain
        if head.fingerprint != done.head.fingerprint:
            del self._done[number]
            return False
        self._numbers_stand()
        self._partial.pop(number, None)
        return True

    def asked_about(self, number: int, checksum: int) -> None:
        """The sender asks for its message with this checksum. Call `heard` before."""
        done = self._done.get(number)
        if done is not None and done.head.checksum != checksum:
            del self._done[number]
        elif done is not None:
            self._numbers_stand()

    def _numbers_stand(self) -> None:
        """The numbers have not gone round since the latest messages were complete."""
        for number, done in self._done.items():
            if not done.is_certain:
                self._done[number] = done._replace(is_certain=True)

    def heard(self, number: int, now_s: float) -> None:
        """The sender uses this number: forget messages that it cannot have under way any more."""
        for other in [n for n in self._partial if _LIVE <= (number - n) & 255 < 192]:
            del self._partial[other]
        was_silent = now_s - self._heard_s >= SILENCE_S
        self._heard_s = now_s
        for other, done in list(self._done.items()):
            if was_silent:
                self._done[other] = done._replace(is_certain=False)
            if _LIVE <= (number - other) & 255 < 192 or now_s - done.since_s >= DONE_S:
                del self._done[other]

    def has(self, number: int) -> int:
        """The fragments of a message that have arrived, as bits; COMPLETE for a complete one."""
        done = self._done.get(number)
        if done is not None and done.is_certain:
            return COMPLETE
        partial = self._partial.get(number)
        return partial.has if partial is not None else 0

    def lacks_only_earlier(self, number: int, index: int) -> bool:
        """Whether `index` is the last fragment of a message and others of it are missing."""
        partial = self._partial.get(number)
        return partial is not None and index == partial.count - 1

    def newest_done(self) -> tuple[int, int]:
        """Number of the latest complete message, and the complete ones up to it as bits."""
        certain = [number for number, done in self._done.items() if done.is_certain]
        newest = certain[-1] if certain else 0
        places = ((newest - number) & 255 for number in certain)
        return newest, sum(1 << back for back in places if back < packets.DONE_BITS)

    def expire(self, now_s: float) -> None:
        """Drop messages without recent fragments."""
        for number, partial in list(self._partial.items()):
            if now_s - partial.touched_s >= EXPIRES_S:
                del self._partial[number]


@dataclass(eq=False)
class Inbox:
    """Reassembles the messages of one sender, and decides what to acknowledge and when."""

    _room: int  # bytes of a body
    # Sends an ACK to the sender; None: its messages are to all, with numbers of their own, and get
    # no ACK.
    _acknowledge: Callable[[Ack], None] | None
    _open: Open
    _slowness: float = 1.0  # of the medium, as a factor

    def __post_init__(self) -> None:
        self._ack_delay_s = self._slowness * ACK_DELAY_S
        self._ack_within_s = self._slowness * ACK_LATEST_S
        self._repeat_s = self._slowness * REPEAT_S
        self._session = -1
        self._former = (-1, -math.inf)  # the session before, and when it ended
        self._reassembly = Reassembly(self._room, self._open)
        self._ports: OrderedDict[tuple[int, bool], PortOrder] = OrderedDict()
        self._unacknowledged = 0  # fragments of complete messages
        self._complete = 0  # number of the latest complete reliable message
        self._repeated_s = -math.inf
        self._asked: Poll | None = None  # what the next ACK is about; None: the latest complete one
        self.ack_due_s = self._ack_latest_s = math.inf

    def fragment(self, index: int, body: bytes, now_s: float) -> list[Whole]:
        """Process a fragment; returns deliverable messages. Raises PacketError if damaged."""
        held: list[Whole] = []
        head = packets.head_of(body) if index == 0 else None
        if head is not None:
            former, ended_s = self._former
            if head.session == former and now_s - ended_s < FORMER_SESSION_S:
                return []  # it is late
            if head.session != self._session:
                held = self._start_over(head.session, now_s)
        return held + self._accept(index, head, body, now_s)

    def _accept(self, index: int, head: Head | None, body: bytes, now_s: float) -> list[Whole]:
        """Process a fragment of the current session; returns deliverable messages."""
        if now_s < self.ack_due_s < math.inf:
            self.ack_due_s = min(now_s + self._ack_delay_s, self._ack_latest_s)
        number, reassembly = body[0], self._reassembly
        reassembly.heard(number, now_s)
        if reassembly.is_done(number, head):
            self._repeat_ack(number, now_s)
            return []
        whole = reassembly.add(index, head, body, now_s)
        if whole is None:
            if reassembly.lacks_only_earlier(number, index):
                self._repeat_ack(number, now_s)
            return []
        if whole.head.reliable and self._acknowledge is not None:
            self._completed(whole, index, now_s)
        return self._order(whole).add(whole, now_s)

    @property
    def unfinished(self) -> bool:
        """Whether messages are incomplete, or wait for earlier ones."""
        return len(self._reassembly) > 0 or any(order.held for order in self._ports.values())

    def poll(self, poll: Poll, now_s: float) -> None:
        """The sender asks for an ACK: it is due now."""
        if poll.nonce == packets.NO_ANSWER:
            return
        if poll.session == self._session:
            self._reassembly.heard(poll.number, now_s)
            self._reassembly.asked_about(poll.number, poll.checksum)
        self._asked = poll
        self.ack_due_s = min(self.ack_due_s, now_s)

    def acknowledge(self) -> None:
        """Send the ACK that is due."""
        assert self._acknowledge is not None  # otherwise none becomes due
        asked = self._asked or Poll(self._session, packets.NO_ANSWER, self._complete)
        self._asked, self._unacknowledged, self.ack_due_s = None, 0, math.inf
        has = newest = done = 0
        if asked.session == self._session:
            newest, done = self._reassembly.newest_done()
            has = self._reassembly.has(asked.number)
        self._acknowledge(Ack(asked.session, asked.nonce, asked.number, has, newest, done))

    def on_time(self, now_s: float) -> list[Whole]:
        """Return the messages that have waited too long for missing earlier ones."""
        self._reassembly.expire(now_s)
        overdue = []
        for order in self._ports.values():
            if order.held:
                overdue += order.overdue(now_s)
        return overdue

    def _start_over(self, session: int, now_s: float) -> list[Whole]:
        """The sender has restarted: returns the messages that waited for earlier ones."""
        held = [whole for order in self._ports.values() for whole in order.overdue(math.inf)]
        if self._session != -1:
            self._former = self._session, now_s
        self._session = session
        self._reassembly = Reassembly(self._room, self._open)
        self._ports.clear()
        self._asked, self._unacknowledged, self.ack_due_s = None, 0, math.inf
        return held

    def _order(self, whole: Whole) -> PortOrder:
        key = (whole.head.port, whole.head.reliable)
        self._ports[key] = order = self._ports.pop(key, None) or PortOrder()
        if len(self._ports) > MOST_PORTS:
            oldest = next(iter(self._ports))
            idle = (one for one, its in self._ports.items() if one != key and not its.held)
            del self._ports[next(idle, oldest)]  # what waits was acknowledged
        return order

    def _completed(self, whole: Whole, index: int, now_s: float) -> None:
        count = whole.fragments
        self._complete = whole.head.number
        self._unacknowledged += count
        if self._unacknowledged >= ACK_AT or index != count - 1:
            self.ack_due_s = min(self.ack_due_s, now_s)
        elif self.ack_due_s > now_s:
            if self.ack_due_s == math.inf:
                self._ack_latest_s = now_s + self._ack_within_s
            self.ack_due_s = min(now_s + self._ack_delay_s, self._ack_latest_s)

    def _repeat_ack(self, number: int, now_s: float) -> None:
        if self._acknowledge is not None and now_s - self._repeated_s >= self._repeat_s:
            self._repeated_s = now_s
            self._asked = self._asked or Poll(self._session, packets.NO_ANSWER, number)
            self.ack_due_s = min(self.ack_due_s, now_s)
