"""Reassembly: collects the fragments of messages from one sender."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Callable, NamedTuple, Optional

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.packets import COMPLETE, Head

EXPIRES_S = 60.0  # an incomplete message is dropped after this time without fragments
MOST_PARTIAL = 24  # incomplete messages of one sender, which has at most 16 under way
_LIVE = 64  # numbers: older messages are no longer under way
DONE_S = 300.0  # longer than a sender retries (LIFETIME_S of outgoing.py)
SILENCE_S = 5.0  # in less, a sender does not use 192 numbers that all get lost


Open = Callable[[bytes, bytes], Optional[bytes]]
"""Turns the place and the sealed bytes of a message into its content; None: not authentic."""


class Whole(NamedTuple):
    """A complete message."""

    head: Head
    payload: bytes


class _Done(NamedTuple):
    """A message that was complete. Its number comes again after 256 messages.

    After a silence of its sender a fragment 0 or a POLL tells whether the numbers still stand.
    """

    fingerprint: tuple[int, ...]
    since_s: float
    is_certain: bool = True


class _Partial:
    __slots__ = ("bodies", "has", "head", "touched_s")

    def __init__(self) -> None:
        self.head: Head | None = None
        self.bodies: dict[int, bytes] = {}
        self.has = 0
        self.touched_s = 0.0


class Reassembly:
    """Reassembles the messages of one sender. Memory: MOST_PARTIAL messages at most."""

    def __init__(self, room: int, open_message: Open) -> None:
        """`room`: bytes of a body."""
        self._room = room
        self._open = open_message
        self._partial: OrderedDict[int, _Partial] = OrderedDict()  # by number, oldest first
        self._done: OrderedDict[int, _Done] = OrderedDict()  # the latest complete ones, by number
        self._heard_s = -math.inf

    def add(self, index: int, body: bytes, now_s: float) -> Whole | None:
        """Add a fragment; returns the message if it is complete. Drops damaged messages."""
        number = body[0]
        partial = self._partial.get(number)
        if partial is None:
            partial = self._begin(number)
        partial.touched_s = now_s
        if index == 0:
            head = packets.head_of(body)
            if partial.head is not None and partial.head.fingerprint != head.fingerprint:
                partial = self._begin(number)  # the number now belongs to another message
                partial.touched_s = now_s
            partial.head = head
        partial.bodies[index] = body
        partial.has |= 1 << index
        head_now = partial.head
        if head_now is None:
            return None
        count = packets.count_of(head_now.length, self._room)
        if partial.has & (1 << count) - 1 != (1 << count) - 1:
            return None
        del self._partial[number]
        payload = packets.joined(
            [partial.bodies[n] for n in range(count)], head_now.length, self._room
        )
        return self._checked(head_now, payload)

    def _checked(self, head: Head, sealed: bytes) -> Whole | None:
        """The content of the message; None if it is damaged or not authentic."""
        if packets.checksum(head.session, head.port, head.order, sealed) != head.checksum:
            return None
        payload = self._open(packets.place_of(head.session, head.port, head.order), sealed)
        if payload is None or len(payload) > packets.MAX_MESSAGE_BYTES:
            return None
        return Whole(head, payload)

    def __len__(self) -> int:
        """The number of incomplete messages."""
        return len(self._partial)

    def is_done(self, index: int, body: bytes) -> bool:
        """Whether a fragment belongs to a complete message, so that it is a duplicate.

        Call `heard` before.
        """
        number = body[0]
        done = self._done.get(number)
        if done is None:
            return False
        if index > 0:
            return done.is_certain
        if packets.head_of(body).fingerprint != done.fingerprint:
            del self._done[number]
            return False
        self._numbers_stand()
        self._partial.pop(number, None)
        return True

    def asked_about(self, number: int, checksum: int) -> None:
        """The sender asks for its message with this checksum. Call `heard` before."""
        done = self._done.get(number)
        if done is not None and done.fingerprint[-1] != checksum:
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

    def done(self, head: Head, now_s: float) -> None:
        """The message is complete."""
        self._done.pop(head.number, None)
        self._done[head.number] = _Done(head.fingerprint, now_s)
        while len(self._done) > _LIVE:
            self._done.popitem(last=False)

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
        if partial is None or partial.head is None:
            return False
        return index == packets.count_of(partial.head.length, self._room) - 1

    def newest_done(self) -> tuple[int, int]:
        """Number of the latest complete message, and the complete ones up to it as bits."""
        certain = [number for number, done in self._done.items() if done.is_certain]
        if not certain:
            return 0, 0
        newest = certain[-1]
        bits = 0
        for number in certain:
            back = (newest - number) & 255
            if back < packets.DONE_BITS:
                bits |= 1 << back
        return newest, bits

    def expire(self, now_s: float) -> None:
        """Drop messages without recent fragments."""
        for number, partial in list(self._partial.items()):
            if now_s - partial.touched_s >= EXPIRES_S:
                del self._partial[number]

    def _begin(self, number: int) -> _Partial:
        self._partial.pop(number, None)
        while len(self._partial) >= MOST_PARTIAL:
            self._partial.popitem(last=False)
        partial = self._partial[number] = _Partial()
        return partial
