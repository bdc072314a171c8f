"""Swallowing: notices that the route to the gateway carries heartbeats and nothing else.

docs/security.md, "A relay that swallows". A captured relay can forward heartbeats, so that the
nodes behind it stay connected, and drop all other packets. With a key, only the gateway itself can
answer a request for its place. If it answers heartbeats but repeatedly does not answer this
request, a node on the route swallows packets.
"""

from __future__ import annotations

import math

ASK_PERIODS = 3.0  # our choice, in check periods: one packet and its answer in half a minute
LEAST_UNANSWERED = 2  # our choice: for a next hop chosen because another one swallowed packets


class Swallowing:
    """Counts unanswered questions to one gateway."""

    def __init__(self, check_period_s: float) -> None:
        self._ask_period_s = ASK_PERIODS * check_period_s
        self._answers = False  # whether this gateway knows its place and answers at all
        self._unanswered = 0
        self._asked_s = -math.inf

    def must_ask(self, now_s: float) -> bool:
        """Whether to ask the gateway in this check: in each one after a question without answer."""
        return self._unanswered > 0 or now_s - self._asked_s >= self._ask_period_s

    def asked(self, now_s: float) -> None:
        """The gateway was asked for its place."""
        self._asked_s = now_s
        self._unanswered += 1

    def answered(self) -> None:
        """It answered."""
        self._answers = True
        self._unanswered = 0

    def noticed(self, hops: int) -> bool:
        """Whether packets are swallowed on the route, which is `hops` long.

        Nodes with fewer hops come to this conclusion sooner. So the node next to the relay is the
        first to change its next hop, and the nodes behind it need not change theirs.
        """
        return self._answers and self._unanswered >= max(LEAST_UNANSWERED, hops)

    def another_next_hop(self, hops: int) -> None:
        """The route has changed, and must soon prove that it works."""
        self._unanswered = max(0, hops - LEAST_UNANSWERED)

    def give_up(self) -> None:
        """Stop suspecting: there is another gateway, or it is silent through every next hop."""
        self._answers = False
        self._unanswered = 0
