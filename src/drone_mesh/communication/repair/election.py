"""The election of the drone of a group that flies: bids, whom to believe, and who took off.

docs/repair.md, "Negotiation".
"""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import AbstractSet

from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.wire.messages import MovementNegotiationMessage
from drone_mesh.drone.location import Location

NO_BID = -1.0  # the score of a node that does not fly
LOOKS = 0.0  # below all other scores that win: it looks beside a node that its group does not reach
MAX_SCORE_M = 1e9  # beyond every possible place, and it fits a float32
TOOK_OFF = 2e9  # sent in place of a score: the winner takes off
TOOK_OFF_HOME = 3e9  # the same, and it flies to the gateway's place
BACKUP = 5e9  # sent in place of a score: who receives it is the backup of its creator
HOME_FAILED = 4e9  # sent in place of NO_BID: no gateway answered at the gateway's place
WINNERS_WITHOUT_FLIGHT = 3  # a winner may also fail to fly for honest reasons


def as_on_the_air(score: float) -> float:
    """A score rounded as in a packet, so that equal scores are equal for both nodes."""
    return MovementNegotiationMessage.from_payload(
        MovementNegotiationMessage(0, 0, 0, 0, score).to_payload()
    ).cost


class Election:
    """The negotiation list of one node, and how long it waits for the bids of others.

    The best bid travels through the whole group: each node relays a bid that beats all bids that it
    has heard, so a group has one winner and not one per neighbourhood.
    """

    def __init__(self, patience_s: float) -> None:
        """`patience_s`: how long to wait for a bid, and how long a bid remains valid."""
        self._patience_s = patience_s
        self.clear()

    def clear(self) -> None:
        """Empty the list and stop waiting."""
        # By node: when its bid was heard, and the score: negative, if it does not fly.
        self._bids: dict[int, tuple[float, float]] = {}
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
        patience_s = self._patience_s
        self._bids = {n: bid for n, bid in self._bids.items() if now_s - bid[0] <= patience_s}
        if node in self._passed_over:
            return False
        _heard_s, before = self._bids.get(node, (now_s, math.nan))
        self._bids[node] = now_s, score
        return before != score and score >= 0 and self.winner() == node

    def knows(self, node: int) -> bool:
        return node in self._bids

    def due_s(self, neighbours: AbstractSet[int]) -> float:
        """When the election is decided unless another bid arrives."""
        if neighbours <= self._bids.keys() | self._passed_over:
            return self._settled_s
        return max(self._settled_s, self._started_s + self._patience_s)

    def winner(self) -> int | None:
        """Highest score, of equal scores the lowest id; None without a bid of 0 or more."""
        able = [(-score, node) for node, (_heard_s, score) in self._bids.items() if score >= 0]
        return min(able)[1] if able else None

    def pass_over(self, node: int) -> None:
        """`node` won but did not fly: start again without it."""
        self._passed_over.add(node)
        self._bids.clear()


class BidCredit:
    """The neighbours that a router trusts to relay bids.

    A key proves that a bid comes from the mesh, not that its creator exists or intends to fly: a
    captured node can relay bids of any number of others.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """The router is connected: trust all neighbours again."""
        self._brought_by: dict[int, int] = {}  # creator of a bid -> neighbour that relayed it
        self._without_flight: Counter[int] = Counter()  # by neighbour: winners that did not fly

    def believes(self, node: int, score: float, from_: int, most: float) -> bool:
        """Whether to count a bid of `node` relayed by `from_`; `most`: see highest_plausible."""
        if score > most or self._without_flight[from_] >= WINNERS_WITHOUT_FLIGHT:
            return False
        self._brought_by[node] = from_
        return True

    def did_not_fly(self, winner: int) -> None:
        """The winner did not take off."""
        self._without_flight[self._brought_by.get(winner, NO_ROUTE)] += 1


def highest_plausible(own: Location | None, gateway: Location | None, range_m: float) -> float:
    """The highest bid that a node of the group can have, in metres.

    The group is connected, so none of its nodes is farther away than a chain of all ids.
    """
    if own is None or gateway is None:
        return MAX_SCORE_M  # less than the codes, which not every strategy reads
    return own.distance_m(gateway) + MAX_NODE_ID * range_m


MOST_GOALS = 6  # of flights that are remembered
MOST_DOUBLINGS = 6  # of the time between two drones that look for a gateway: to half a day


class FlightNews:
    """Which drones took off, and where they looked for the gateway."""

    drone_flew = False  # one of the group, since the connection was lost
    flew_s = -math.inf  # when a drone of the group took off, or this one
    home_s = -math.inf  # the same for flights to the gateway's place

    def __init__(self) -> None:
        self._quiet_until_s = -math.inf
        self._tries: dict[Location, float] = {}  # gateway's place -> when another may fly there
        self._failures: set[tuple[int, Location | None]] = set()  # that were reported
        self._failed_s: dict[int, float] = {}  # node -> when it reported a failed flight there
        self.goals: deque[Location] = deque(maxlen=MOST_GOALS)  # of others, but the gateway's place

    def took_off(self, now_s: float, quiet_until_s: float) -> None:
        """Another drone takes off: the others wait for its outcome until `quiet_until_s`."""
        self.drone_flew = True
        self.flew_s = now_s
        self._quiet_until_s = quiet_until_s

    def is_quiet(self, now_s: float) -> bool:
        """Whether the group waits for a drone in flight."""
        return now_s < self._quiet_until_s

    def tries(self, place: Location | None, now_s: float, keep_s: float) -> None:
        """A drone looks or looked for the gateway at `place`; no other flies there for `keep_s`."""
        self._tries = {tried: at_s for tried, at_s in self._tries.items() if now_s < at_s}
        if place is not None:
            until_s = now_s + keep_s
            self._tries[place] = max(until_s, self._tries.get(place, until_s))

    def is_tried(self, place: Location, now_s: float, near_m: float) -> bool:
        """Whether a drone has been so close to `place` that a gateway there would have answered."""
        return any(
            now_s < until_s and place.distance_m(tried) < near_m
            for tried, until_s in self._tries.items()
        )

    def failed(
        self, node: int, place: Location | None, now_s: float, keep_s: float, again_s: float
    ) -> bool:
        """`node` found no gateway at `place`; returns whether it says so first within `again_s`.

        What it repeats in later rounds does not keep others away from the place for longer.
        """
        if now_s < self._failed_s.get(node, -math.inf) + again_s:
            return False
        self._failed_s[node] = now_s
        if (node, place) not in self._failures:
            doublings = min(len(self._failures), MOST_DOUBLINGS)  # the gateway is off, it seems
            self._failures.add((node, place))
            self.tries(place, now_s, keep_s * 2**doublings)
        return True

    def in_vain(self) -> frozenset[int]:
        """The nodes that reported it."""
        return frozenset(self._failed_s)
