"""Train: the packets sent to a node behind relays before that node has answered."""

from __future__ import annotations

import math

FIRST_LENGTH = 32  # our choice, in fragments
LEAST_LENGTH = 8  # our choice
MOST_LENGTH = 80  # our choice: two messages of 1,024 bytes; a relay forwards it in one piece


class Train:
    """The packets of one outbox since its receiver's last answer, on a shared channel.

    A relay cannot receive while it sends, and a sender hears only the first relay, so packets sent
    while earlier ones are under way collide with them. Therefore packets are sent in trains that
    end with a POLL, and the next train follows the answer. If a train loses packets or remains
    without an answer, the next ones are shorter.
    """

    def __init__(self) -> None:
        self.length = FIRST_LENGTH
        self.left = 0  # fragments that left
        self.is_open = False  # relays wait for more of it
        self.nonce = 0  # of its latest POLL; 0: none
        self.asks = 0  # POLLs without an answer
        self.asked_s = math.inf

    @property
    def is_full(self) -> bool:
        """Whether to send a POLL next."""
        return self.left >= self.length

    @property
    def waits(self) -> bool:
        """Whether the next train waits for an answer."""
        return self.asks > 0

    def asked(self, nonce: int, now_s: float) -> None:
        """Its POLL was sent."""
        self.nonce, self.asked_s = nonce, now_s
        self.asks += 1

    def end(self, arrived: bool) -> None:
        """The train is over; `arrived`: nothing of it is known to be missing."""
        if not arrived:
            self.length = max(LEAST_LENGTH, self.length // 2)
        elif self.is_full:
            self.length = min(MOST_LENGTH, 2 * self.length)
        self.left = self.nonce = self.asks = 0
        self.asked_s = math.inf
