"""KnownPlaces: the gateway's place, and the places to step back to."""

from __future__ import annotations

import math

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.location import Location

UNKNOWN_HOPS = 10  # to the gateway, for a router that never was connected
SAME_PLACE_M = 0.5  # places travel as float32, heights in whole metres
# A node of 2019 does not say that a place is its goal; it is out of reach by then.
WRONG_FOR_S = 30.0


class KnownPlaces:
    """The places that a node might fly to (docs/repair.md, "Places to step back to")."""

    def __init__(self) -> None:
        self.gateway: Location | None = None  # of the preferred gateway
        self.gateway_seen_s = 0.0  # when the gateway was there
        self.gateway_disputed = False  # others say that it is elsewhere; the gateway itself decides
        self._by_gateway = False  # the gateway itself said so
        self.good: Location | None = None  # the last good known location
        self.good_id = NO_ROUTE  # the node at that place
        self.good_seen_s = 0.0  # when it was there
        self.connected_at: Location | None = None  # where this node was connected last
        self._connected_hops = UNKNOWN_HOPS  # to its gateway, there
        self._wrong_since_s: dict[bool, float] = {}  # places of the gateway, and of the next hop

    def connected_here(self, here: Location | None, hops: int) -> None:
        """The node is connected, `hops` away from its gateway."""
        self.connected_at = here or self.connected_at
        if hops != NO_ROUTE:
            self._connected_hops = hops

    def is_possible(self, place: Location, range_m: float, gateway: bool) -> bool:
        """Whether the next hop, or the gateway, can be there, as far as one radio reaches."""
        hops = self._connected_hops if gateway else 1
        here = self.connected_at
        return here is None or math.dist(here, place) <= (hops + 1) * range_m

    def is_still_wrong(self, gateway: bool, wrong: bool, now_s: float) -> bool:
        """Whether the gateway, or the next hop, has reported only wrong places for some time."""
        if not wrong:
            self._wrong_since_s.pop(gateway, None)
            return False
        return now_s - self._wrong_since_s.setdefault(gateway, now_s) >= WRONG_FOR_S

    @property
    def asks_gateway(self) -> bool:
        """Whether only the gateway itself can tell where it is."""
        return self.gateway is None or self.gateway_disputed or not self._by_gateway

    def update_gateway(self, place: Location, seen_s: float) -> None:
        """The preferred gateway itself was at `place` at `seen_s`; older news is ignored."""
        if self.gateway is None or seen_s >= self.gateway_seen_s:
            self.gateway, self.gateway_seen_s, self._by_gateway = place, seen_s, True
            self.gateway_disputed = False

    def hear_of_gateway(self, place: Location, seen_s: float, connected: bool) -> None:
        """Note where another node says the gateway was; if `connected`, only as a doubt."""
        if self.gateway is not None and seen_s < self.gateway_seen_s:
            return
        if self.gateway is not None and place.distance_m(self.gateway) < SAME_PLACE_M:
            self.gateway_seen_s = seen_s
        elif self.gateway is not None and (connected or self._by_gateway):
            self.gateway_disputed = True
        else:
            self.gateway, self.gateway_seen_s, self._by_gateway = place, seen_s, False

    def gateway_not_found(self) -> None:
        """The node was at the gateway's place in vain: others may know better."""
        self._by_gateway = False

    def update_next_hop(self, node: int, place: Location, seen_s: float) -> None:
        """The next hop towards the gateway is `node`; it was at `place` at `seen_s`."""
        self.good, self.good_id, self.good_seen_s = place, node, seen_s

    def forget_gateway(self) -> None:
        """The node prefers another gateway."""
        self.gateway, self._by_gateway, self.gateway_disputed = None, False, False
        self._connected_hops = UNKNOWN_HOPS

    def left_own_place(self, gateway: int) -> None:
        """The node flies: the next step back leads to the place of `gateway`, if that is known."""
        self.good, self.good_seen_s = self.gateway, self.gateway_seen_s
        self.good_id = NO_ROUTE if self.gateway is None else gateway
