"""FeasibleRoutes: the updates of neighbours, and which of them cannot form a loop.

RFC 8966, 3.5 to 3.8: the source table and the route table of Babel, for gateways.
"""

from __future__ import annotations

from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.techniques.gateway_routes import LinkCosts, newer_by

COST_PER_ETX = 256  # RFC 8966, appendix A.2.2
INFINITE = 0xFFFF


class Distance(NamedTuple):
    """A sequence number and a metric; a feasible one is newer, or as new and smaller."""

    sequence: int
    metric: int

    def better_than(self, other: Distance) -> bool:
        """RFC 8966, 3.5.1."""
        newer = newer_by(self.sequence, other.sequence)
        return newer > 0 or (newer == 0 and self.metric < other.metric)


class FeasibleRoutes:
    """Routes to gateways through neighbours. Called only by the technique that owns it."""

    def __init__(self, links: LinkCosts) -> None:
        self._links = links
        self._updates: dict[int, dict[int, Distance]] = {}  # by gateway, by neighbour
        self._feasibility: dict[int, Distance] = {}  # by gateway: the best ever advertised

    def hear(self, gateway: int, neighbour: int, update: Distance) -> None:
        """Store an update from a neighbour."""
        self._updates.setdefault(gateway, {})[neighbour] = update

    def best(self, gateway: int) -> int:
        """The feasible neighbour with the smallest sum of its metric and the link's cost."""
        updates, limit = self._updates.get(gateway, {}), self._feasibility.get(gateway)
        costs = {
            n: self._cost(n, update)
            for n, update in updates.items()
            if update.metric != INFINITE and (limit is None or update.better_than(limit))
        }
        return min(costs, key=lambda n: (costs[n], n)) if costs else NO_ROUTE

    def advertise(self) -> list[tuple[int, Distance]]:
        """(gateway, own distance) of each gateway. Advertised distances bound what is feasible."""
        found = [(gateway, self._distance(gateway)) for gateway in self._updates]
        for gateway, update in found:
            limit = self._feasibility.get(gateway)
            if update.metric != INFINITE and (limit is None or update.better_than(limit)):
                self._feasibility[gateway] = update
        return found

    def forget_neighbour(self, neighbour: int) -> list[int]:
        """Drop its updates. Returns the gateways that no feasible route leads to now."""
        return [
            gateway
            for gateway, updates in self._updates.items()
            if updates.pop(neighbour, None) and self.best(gateway) == NO_ROUTE
        ]

    def forget_gateway(self, gateway: int) -> None:
        """Drop all updates for it until they are repeated."""
        self._updates.get(gateway, {}).clear()

    def needed_sequence(self, gateway: int) -> int | None:
        """The sequence number that would make a route feasible again; None: any would."""
        limit = self._feasibility.get(gateway)
        return None if limit is None else (limit.sequence + 1) % 2**16

    def _distance(self, gateway: int) -> Distance:
        to = self.best(gateway)
        if to == NO_ROUTE:
            limit = self._feasibility.get(gateway, Distance(0, INFINITE))
            return Distance(limit.sequence, INFINITE)
        update = self._updates[gateway][to]
        return Distance(update.sequence, self._cost(to, update))

    def _cost(self, neighbour: int, update: Distance) -> int:
        return min(update.metric + round(COST_PER_ETX * self._links.etx(neighbour)), INFINITE - 1)
