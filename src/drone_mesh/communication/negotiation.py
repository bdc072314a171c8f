"""Which node of a group without a gateway flies back (docs/protocol.md, "Negotiation")."""

from __future__ import annotations

import math
from typing import AbstractSet, NamedTuple

NO_BID = -1.0  # the score of a node that does not fly


class Bid(NamedTuple):
    """The bid of a node to fly."""

    score: float  # metres to the gateway's place; negative: does not fly
    heard_s: float


class Negotiation:
    """The negotiation list of one node, and how long it waits for the bids of others."""

    def __init__(self, patience_s: float) -> None:
        """`patience_s`: how long to wait for a bid, and how long a bid stays good."""
        self._patience_s = patience_s
        self._bids: dict[int, Bid] = {}
        self.due_s = math.inf  # when waiting ends; infinity while this node does not wait

    def start(self, own_id: int, own_score: float, now_s: float) -> None:
        """Put the own bid into the list and begin to wait."""
        self.heard(own_id, own_score, now_s)
        self.due_s = now_s + self._patience_s

    def heard(self, node: int, score: float, now_s: float) -> None:
        """Put a bid into the list and drop those that are too old to count."""
        self._bids[node] = Bid(score, now_s)
        for other in [n for n, bid in self._bids.items() if now_s - bid.heard_s > self._patience_s]:
            del self._bids[other]

    def is_decided(self, neighbours: AbstractSet[int], now_s: float) -> bool:
        """Whether every neighbour has bid, or has had its time."""
        return now_s >= self.due_s or neighbours <= self._bids.keys()

    def winner(self) -> int | None:
        """Highest score, of equal scores the lowest id; None without a bid of 0 or more."""
        able = [(-bid.score, node) for node, bid in self._bids.items() if bid.score >= 0]
        return min(able)[1] if able else None

    def clear(self) -> None:
        """Empty the list and stop waiting."""
        self._bids.clear()
        self.due_s = math.inf
