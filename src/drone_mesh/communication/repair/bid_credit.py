"""BidCredit: decides which bids to trust (docs/repair.md, "Negotiation").

A key proves that a bid comes from the mesh, not that its creator exists or intends to fly: a
captured node can relay bids of any number of others.
"""

from __future__ import annotations

from collections import Counter

from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE
from drone_mesh.drone.location import Location

WINNERS_WITHOUT_FLIGHT = 3  # a winner may also fail to fly for honest reasons


class BidCredit:
    """The neighbours that a router trusts to relay bids."""

    def __init__(self) -> None:
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

    def clear(self) -> None:
        """The router is connected: trust all neighbours again."""
        self._brought_by.clear()
        self._without_flight.clear()


def highest_plausible(own: Location | None, gateway: Location | None, range_m: float) -> float:
    """The highest bid that a node of the group can have, in metres.

    The group is connected, so none of its nodes is farther away than a chain of all ids.
    """
    if own is None or gateway is None:
        return float("inf")
    return own.distance_m(gateway) + MAX_NODE_ID * range_m
