"""KnownPlaces: where the gateway is, and where to step back to."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.interfaces import Location


class KnownPlaces:
    """The places that a node has heard of and might fly to (docs/protocol.md,
    "Places to step back to")."""

    def __init__(self) -> None:
        self.gateway: Location | None = None  # of the preferred gateway
        self.good: Location | None = None  # the last good known location
        self.good_id = NO_ROUTE  # the node whose place that is

    def heard(self, node: int, place: Location, gateway: int, next_hop: int) -> None:
        """`node` is at `place`; `next_hop` leads to the preferred gateway `gateway`."""
        if node == gateway:
            self.gateway = place
        if node != gateway or node == next_hop:
            self.good, self.good_id = place, node

    def forget_gateway(self) -> None:
        """The node prefers another gateway."""
        self.gateway = None

    def left_own_place(self, gateway: int) -> None:
        """The node flies: the next step back is to the place of `gateway`, if that is known."""
        self.good = self.gateway
        self.good_id = NO_ROUTE if self.gateway is None else gateway
