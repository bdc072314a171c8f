"""Ordering: delivers each message of a sender once, in the order of sending per port."""

from __future__ import annotations

from collections import deque

from drone_mesh.communication.data.packets import MOST_BEHIND, Whole

HOLD_S = 300.0  # longer than a sender retries (LIFETIME_S of outgoing.py)
_HALF = 1 << 15


def ahead(order: int, of: int) -> int:
    """How many places `order` is ahead of the place `of`; negative: behind it (RFC 1982)."""
    return (order - of + _HALF) % (1 << 16) - _HALF


class PortOrder:
    """The messages of one sender to one port, with one kind of delivery.

    Memory: as many messages as a sender may have under way, MOST_BEHIND + 1.

    A reliable message that arrives after the sender seemed to have given it up is delivered late:
    its sender may have been told that it is here, and `behind` is not sealed (docs/security.md).
    """

    def __init__(self) -> None:
        self._next: int | None = None  # the place of the message to deliver next
        self.held: dict[int, tuple[Whole, float]] = {}  # complete, but earlier ones are missing
        self._given_up: deque[int] = deque(maxlen=MOST_BEHIND)  # places that were not waited for

    def add(self, whole: Whole, now_s: float) -> list[Whole]:
        """Add a complete message; returns what can be delivered now. Ignores duplicates."""
        order = whole.head.order
        if not whole.head.reliable:
            if self._next is not None and ahead(order, self._next) < 0:
                return []  # it is late, or a duplicate
            self._next = (order + 1) & 0xFFFF
            return [whole]
        oldest = (order - whole.head.behind) & 0xFFFF
        if self._next is None:
            self._next = oldest
            self._given_up.extend((oldest - n) & 0xFFFF for n in range(MOST_BEHIND, 0, -1))
        if order in self._given_up:
            self._given_up.remove(order)
            if ahead(order, self._next) < 0:
                return [whole]
        if ahead(order, self._next) < 0 or order in self.held:
            return []
        self.held[order] = whole, now_s
        return self._ready_up_to(oldest)

    def overdue(self, now_s: float) -> list[Whole]:
        """Messages that have waited for so long that no earlier one can arrive."""
        waited = [order for order, (_, since_s) in self.held.items() if now_s - since_s >= HOLD_S]
        if not waited or self._next is None:
            return []
        next_place = self._next
        return self._ready_up_to(max(waited, key=lambda order: ahead(order, next_place)))

    def _ready_up_to(self, oldest: int) -> list[Whole]:
        """The held messages before `oldest`, and those from there up to the first gap.

        Those before `oldest` that are missing are no longer waited for.
        """
        ready = []
        place = self._next if self._next is not None else oldest
        for back in range(min(ahead(oldest, place), MOST_BEHIND), 0, -1):
            if (oldest - back) & 0xFFFF not in self.held:
                self._given_up.append((oldest - back) & 0xFFFF)
        while ahead(oldest, place) > 0 or place in self.held:
            held = self.held.pop(place, None)
            if held is not None:
                ready.append(held[0])
            elif not self.held:
                place = oldest
                break
            place = (place + 1) & 0xFFFF
        self._next = place
        return ready
