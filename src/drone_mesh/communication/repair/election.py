"""Elects the drone that flies, in a group without a gateway (docs/repair.md, "Negotiation")."""

from __future__ import annotations

import math
from typing import AbstractSet, NamedTuple

from drone_mesh.communication.wire.messages import MovementNegotiationMessage

NO_BID = -1.0  # the score of a node that does not fly
MAX_SCORE_M = 1e9  # beyond every possible place, and it fits a float32
TOOK_OFF = 2e9  # sent in place of a score: the winner takes off
TOOK_OFF_HOME = 3e9  # the same, and it flies to the gateway's place
HOME_FAILED = 4e9  # sent in place of NO_BID: no gateway answered at the gateway's place


def as_on_the_air(score: float) -> float:
    """A score rounded as in a packet, so that equal scores are equal for both nodes."""
    return MovementNegotiationMessage.from_payload(
        MovementNegotiationMessage(0, 0, 0, 0, score).to_payload()
    ).cost


class Bid(NamedTuple):
    """The bid of a node to fly."""

    score: float  # metres to the gateway's place; negative: does not fly
    heard_s: float


class Election:
    """The negotiation list of one node, and how long it waits for the bids of others.

    The best bid travels through the whole group: each node relays a bid that beats all bids that it
    has heard, so a group has one winner and not one per neighbourhood.
    """

    def __init__(self, patience_s: float) -> None:
        """`patience_s`: how long to wait for a bid, and how long a bid remains valid."""
        self._patience_s = patience_s
        self._bids: dict[int, Bid] = {}
        self._passed_over: set[int] = set()
        self._started_s = self._settled_s = math.inf

    def start(self, own_id: int, own_score: float, now_s: float, settled_s: float) -> None:
        """Put the node's own bid into the list and start waiting.

        Wait at least until `settled_s` for the bids of nodes farther away.
        """
        self._started_s, self._settled_s = now_s, settled_s
        self.heard(own_id, own_score, now_s)

    def heard(self, node: int, score: float, now_s: float) -> bool:
        """Put a bid into the list and drop expired ones.

        Returns whether it is the best bid in the list, and new.
        """
        for other in [n for n, bid in self._bids.items() if now_s - bid.heard_s > self._patience_s]:
            del self._bids[other]
        if node in self._passed_over:
            return False
        before = self._bids.get(node)
        self._bids[node] = Bid(score, now_s)
        is_news = before is None or before.score != score
        return is_news and score >= 0 and self.winner() == node

    def knows(self, node: int) -> bool:
        """Whether `node` has bid."""
        return node in self._bids

    def due_s(self, neighbours: AbstractSet[int]) -> float:
        """When the election is decided unless another bid arrives."""
        if neighbours <= self._bids.keys() | self._passed_over:
            return self._settled_s
        return max(self._settled_s, self._started_s + self._patience_s)

    def winner(self) -> int | None:
        """Highest score, of equal scores the lowest id; None without a bid of 0 or more."""
        able = [(-bid.score, node) for node, bid in self._bids.items() if bid.score >= 0]
        return min(able)[1] if able else None

    def pass_over(self, node: int) -> None:
        """`node` won but did not fly: start again without it."""
        self._passed_over.add(node)
        self._bids.clear()

    def clear(self) -> None:
        """Empty the list and stop waiting."""
        self._bids.clear()
        self._passed_over.clear()
        self._started_s = self._settled_s = math.inf
