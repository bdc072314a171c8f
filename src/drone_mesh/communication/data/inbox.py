"""Inbox: the messages from one sender."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Callable

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.ordering import PortOrder
from drone_mesh.communication.data.packets import COMPLETE, Ack, Poll
from drone_mesh.communication.data.reassembly import Open, Reassembly, Whole
from drone_mesh.communication.timing import Medium

ACK_DELAY_S = 0.02  # complete messages are acknowledged after a pause of this time
ACK_LATEST_S = 0.2  # or after this time without a pause
ACK_AT = 96  # after this many fragments of complete messages an ACK leaves at once
REPEAT_S = 0.3  # least time between unsolicited repetitions of an ACK
MOST_PORTS = 64  # per sender: the order is kept for the ports used last
FORMER_SESSION_S = 30.0  # longer than a packet can take to arrive


class Inbox:
    """Reassembles the messages of one sender, and decides what to acknowledge and when."""

    def __init__(
        self,
        room: int,
        acknowledge: Callable[[Ack], None] | None,
        open_message: Open,
        medium: Medium,
    ) -> None:
        """`acknowledge` sends an ACK to the sender; None: its messages are to all, with numbers of
        their own, and get no ACK. `room`: bytes of a body.
        """
        self._ack_delay_s = medium.stretched(ACK_DELAY_S)
        self._ack_within_s = medium.stretched(ACK_LATEST_S)
        self._repeat_s = medium.stretched(REPEAT_S)
        self._room = room
        self._open = open_message
        self._acknowledge = acknowledge
        self._session = -1
        self._former = (-1, -math.inf)  # the session before, and when it ended
        self._reassembly = Reassembly(room, open_message)
        self._ports: OrderedDict[tuple[int, bool], PortOrder] = OrderedDict()
        self._unacknowledged = 0  # fragments of complete messages
        self._complete = 0  # number of the latest complete reliable message
        self._repeated_s = -math.inf
        self._asked: Poll | None = None  # what the next ACK is about; None: the latest complete one
        self.ack_due_s = self._ack_latest_s = math.inf

    def fragment(self, index: int, body: bytes, now_s: float) -> list[Whole]:
        """Process a fragment; returns deliverable messages. Raises PacketError if damaged."""
        held: list[Whole] = []
        if index == 0:
            session = packets.head_of(body).session
            if self._is_late(session, now_s):
                return []
            if session != self._session:
                held = self._start_over(session, now_s)
        return held + self._accept(index, body, now_s)

    def _accept(self, index: int, body: bytes, now_s: float) -> list[Whole]:
        """Process a fragment of the current session; returns deliverable messages."""
        if now_s < self.ack_due_s < math.inf:
            self.ack_due_s = min(now_s + self._ack_delay_s, self._ack_latest_s)
        number, reassembly = body[0], self._reassembly
        reassembly.heard(number, now_s)
        if reassembly.is_done(index, body):
            self._repeat_ack(number, now_s)
            return []
        whole = reassembly.add(index, body, now_s)
        if whole is None:
            if reassembly.lacks_only_earlier(number, index):
                self._repeat_ack(number, now_s)
            return []
        reassembly.done(whole.head, now_s)
        if whole.head.reliable and self._acknowledge is not None:
            self._completed(whole, index, now_s)
        return self._order(whole).add(whole, now_s)

    @property
    def unfinished(self) -> bool:
        """Whether messages are incomplete, or wait for earlier ones."""
        return len(self._reassembly) > 0 or any(order.holds for order in self._ports.values())

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
        self._acknowledge(self._ack(asked.number, asked.nonce, asked.session))

    def on_time(self, now_s: float) -> list[Whole]:
        """Return the messages that have waited too long for missing earlier ones."""
        self._reassembly.expire(now_s)
        overdue = []
        for order in self._ports.values():
            if order.holds:
                overdue += order.overdue(now_s)
        return overdue

    def _is_late(self, session: int, now_s: float) -> bool:
        """Whether a message belongs to the session before the sender's current one."""
        former, ended_s = self._former
        return session == former and now_s - ended_s < FORMER_SESSION_S

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
        order = self._ports.pop(key, None) or PortOrder()
        self._ports[key] = order
        if len(self._ports) > MOST_PORTS:
            oldest = next(iter(self._ports))
            idle = (one for one, its in self._ports.items() if one != key and not its.holds)
            del self._ports[next(idle, oldest)]  # what waits was acknowledged
        return order

    def _completed(self, whole: Whole, index: int, now_s: float) -> None:
        count = packets.count_of(whole.head.length, self._room)
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

    def _ack(self, number: int, nonce: int, session: int) -> Ack:
        if session != self._session:
            return Ack(session, nonce, number, 0, 0, 0)
        newest, done = self._reassembly.newest_done()
        has = self._reassembly.has(number)
        assert has <= COMPLETE
        return Ack(session, nonce, number, has, newest, done)
