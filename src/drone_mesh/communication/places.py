"""KnownPlaces: the gateway's place, and the places to step back to."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.location import Location


class KnownPlaces:
    """The places that a node might fly to (docs/protocol.md, "Places to step back to")."""

    def __init__(self) -> None:
        self.gateway: Location | None = None  # of the preferred gateway
        self.gateway_seen_s = 0.0  # when the gateway was there
        self.good: Location | None = None  # the last good known location
        self.good_id = NO_ROUTE  # the node at that place
        self.good_seen_s = 0.0  # when it was there

    def update_gateway(self, place: Location, seen_s: float) -> None:
        """The preferred gateway was at `place` at `seen_s`; older information is ignored."""
        if self.gateway is None or seen_s >= self.gateway_seen_s:
            self.gateway, self.gateway_seen_s = place, seen_s

    def update_next_hop(self, node: int, place: Location, seen_s: float) -> None:
        """The next hop towards the gateway is `node`; it was at `place` at `seen_s`."""
        self.good, self.good_id, self.good_seen_s = place, node, seen_s

    def forget_gateway(self) -> None:
        """The node prefers another gateway."""
        self.gateway = None

    def left_own_place(self, gateway: int) -> None:
        """The node flies: the next step back leads to the place of `gateway`, if that is known."""
        self.good, self.good_seen_s = self.gateway, self.gateway_seen_s
        self.good_id = NO_ROUTE if self.gateway is None else gateway
