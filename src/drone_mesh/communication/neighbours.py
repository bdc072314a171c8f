"""Neighbours: the nodes in direct reach, as known from their packets."""

from __future__ import annotations

from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.location import Location


class HeardPlace(NamedTuple):
    """The place that a node reported."""

    place: Location
    heard_s: float


class Neighbours:
    """When each neighbour was last heard, which gateway it uses, and the places of nodes.

    The only owner of this table: the other parts of a component report here what they learn. The
    gateway and place of a node are kept when it is no longer a neighbour.
    """

    def __init__(self, silence_s: float) -> None:
        """`silence_s`: neighbours lost within this time count as lost together."""
        self._silence_s = silence_s
        self._heard_s: dict[int, float] = {}
        self._lost_s: dict[int, float] = {}
        self._gateways: dict[int, int] = {}
        self._hops: dict[int, int] = {}
        self._places: dict[int, HeardPlace] = {}
        self.silent = False  # all neighbours (2 or more) were lost together; none heard since
        self._leaves_them = False  # this node leaves its neighbours by order

    def heard(self, node: int, now_s: float) -> bool:
        """A packet arrived from `node`. Returns whether it is a new neighbour."""
        is_new = node not in self._heard_s
        self._heard_s[node] = now_s
        if is_new:
            self._lost_s.pop(node, None)
            self.silent = False
        return is_new

    def lost(self, node: int, now_s: float) -> bool:
        """`node` is out of reach. Returns whether it was a neighbour."""
        if self._heard_s.pop(node, None) is None:
            return False
        self._lost_s[node] = now_s
        if not self._heard_s and not self._leaves_them:
            together = [at_s for at_s in self._lost_s.values() if now_s - at_s <= self._silence_s]
            self.silent = len(together) >= 2
        return True

    def left_by_order(self) -> None:
        """This node flies elsewhere by order: if it hears no node, its medium still works."""
        self._leaves_them = True
        self.silent = False

    def forget_all(self) -> None:
        """This node moved and may have other neighbours."""
        self._leaves_them = False
        self._heard_s.clear()
        self._lost_s.clear()

    def ids(self) -> frozenset[int]:
        """The current neighbours."""
        return frozenset(self._heard_s)

    def heard_s(self) -> dict[int, float]:
        """A copy: for each neighbour the time of its last packet, in seconds."""
        return dict(self._heard_s)

    def last_heard_s(self, node: int, otherwise: float) -> float:
        """When `node` was last heard; `otherwise` if it is not a neighbour."""
        return self._heard_s.get(node, otherwise)

    # Reported by the nodes themselves--------------------------------------------------------

    def set_gateway(self, node: int, gateway: int) -> None:
        """`node` is connected to `gateway`."""
        self._gateways[node] = gateway

    def gateway_of(self, node: int) -> int:
        """The gateway that `node` reported last, or NO_ROUTE."""
        return self._gateways.get(node, NO_ROUTE)

    def set_hops(self, node: int, hops: int) -> None:
        """`node` introduced itself with `hops` to its gateway; 255: it has none."""
        self._hops[node] = hops

    def hops_of(self, node: int) -> int:
        """The hops that `node` reported last; 255: none."""
        return self._hops.get(node, NO_ROUTE)

    def set_place(self, node: int, place: Location, now_s: float) -> None:
        """`node`, a neighbour or not, reports its place."""
        self._places[node] = HeardPlace(place, now_s)

    def place_of(self, node: int) -> HeardPlace | None:
        """The last reported place of `node`."""
        return self._places.get(node)

    def places(self) -> dict[int, HeardPlace]:
        """All reported places, by node. Do not modify."""
        return self._places
