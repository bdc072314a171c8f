"""Places of others: in which frame, whom to believe, where to step back to, how to ask and tell.

docs/repair.md, "Places to step back to".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Iterable

from drone_mesh.communication.control.delivery import IDelivery
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE, IWirelessCommunication
from drone_mesh.communication.timing import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.drone.location import Location

NO_FRAME: Final = 0  # the digest of a node without an origin, or without support for origins


class CommonFrame:
    """The frames of the neighbours. Belongs to the component's thread."""

    def __init__(self, digest: int) -> None:
        """`digest` is this node's own."""
        self.digest = digest
        self._digests: dict[int, int] = {}  # neighbour -> its digest

    def heard(self, neighbour: int, digest: int) -> bool:
        """Record a neighbour's digest; returns whether its frame is this node's."""
        self._digests[neighbour] = digest
        return digest == self.digest

    def refuses(self, from_: int) -> bool:
        """Whether places from this neighbour may refer to another frame.

        A node with an origin waits for a neighbour's PRESENT; a node without one assumes that a
        neighbour that has not introduced itself has no origin either.
        """
        return self._digests.get(from_, NO_FRAME) != self.digest

    def is_foreign(self, from_: int) -> bool:
        """Whether this neighbour has introduced itself with another frame."""
        return from_ in self._digests and self.refuses(from_)


UNKNOWN_HOPS: Final = 10  # to the gateway, for a router that never was connected
SAME_GATEWAY_M: Final = 0.5  # places travel as float32, heights in whole metres
# A node of 2019 does not say that a place is its goal; it is out of reach by then.
WRONG_FOR_S: Final = 30.0


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
        if self.gateway is not None and place.distance_m(self.gateway) < SAME_GATEWAY_M:
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


@dataclass(eq=False)
class Claims:
    """Compares the claims of others with what one node knows; complains about impossible ones."""

    _frame: CommonFrame
    _places: KnownPlaces
    _complaints: Complaints
    _deadlines: Deadlines
    _range_m: float  # of the radio, as far as the node knows

    def heard_origin(self, neighbour: int, digest: int) -> None:
        """A neighbour tells the digest of its origin; complains if it is not this node's."""
        is_common, now_s = self._frame.heard(neighbour, digest), self._deadlines.now_s
        # The digest of a neighbour with a key, at a node without one, is part of a seal.
        if not is_common and not self._complaints.foreign_neighbour(now_s):
            self._complaints.add("a neighbour has another origin", f"node {neighbour}", now_s)

    def may_be_at(self, place: Location, gateway: bool, says_so: bool) -> bool:
        """Whether the gateway, or else the next hop, can be at `place`; counts it if not.

        `says_so`: that node itself says that it is there now. Complains if it goes on to do so.
        """
        now_s = self._deadlines.now_s
        possible = self._places.is_possible(place, self._range_m, gateway)
        is_wrong = says_so and self._places.is_still_wrong(gateway, not possible, now_s)
        if not possible:
            reason = f"a place where the {'gateway' if gateway else 'next hop'} cannot be"
            if is_wrong:
                self._complaints.add(reason, place.in_words(), now_s)
            else:
                self._complaints.counts[reason] += 1
        return possible


TOLD_M: Final = 0.09  # so much the spots of other drones allow for (TakenPlaces)


@dataclass(eq=False)
class PlaceRequests:
    """The requests of one node, which also tell where it is itself."""

    _node_id: int
    _pilot: Pilot
    _antenna: IWirelessCommunication
    _delivery: IDelivery
    _deadlines: Deadlines

    def __post_init__(self) -> None:
        self._told: Location | None = None  # to all

    def ask(self, node: int) -> bool:
        """Ask `node` for its place, along the route to it; returns whether that has left."""
        return self._delivery.send_own(self._request(node))

    def ask_neighbour(self, node: int) -> None:
        """Ask `node`, in reach, for its place; no route to it is needed."""
        self._antenna.send_message_to(self._request(node))

    def ask_all(self, may_fly_on: bool = False) -> None:
        """Ask every node in range for its place; `may_fly_on`: and of others near, as in flight."""
        self._antenna.broadcast_message(self._request(BROADCAST, may_fly_on))

    def tell_all(self) -> None:
        """Tell every node in range where this one is or flies to: it may fall silent soon.

        Each place once: on a busy channel routers connect anew all the time.
        """
        goal = self._pilot.destination
        place = goal or self._pilot.location()
        if place is None or (self._told and self._told.distance_m(place) < TOLD_M):
            return
        self._told = place
        self._broadcast(place, is_goal=goal is not None)

    def announce(self, goal: Location, acknowledged_by: Iterable[int] = ()) -> None:
        """Tell every node in range where this drone flies, or is about to fly.

        Nobody acknowledges a broadcast: these neighbours are told one by one as well.
        """
        self._broadcast(goal, is_goal=True)
        for neighbour in acknowledged_by:
            self.tell_goal(goal, neighbour)

    def tell_goal(self, goal: Location, neighbour: int) -> None:
        """Tell one neighbour, which acknowledges it."""
        packet = self._own_location(goal, is_goal=True)
        self._antenna.send_message_to(messages.readdressed(packet, neighbour))

    def _broadcast(self, place: Location, is_goal: bool) -> None:
        self._antenna.broadcast_message(self._own_location(place, is_goal))

    def _own_location(self, place: Location, is_goal: bool) -> bytes:
        now_s = self._deadlines.now_s
        return messages.own_location(place, is_goal, now_s, self._node_id, BROADCAST)

    def _request(self, to: int, may_fly_on: bool = False) -> bytes:
        """A request with the place of this node: its destination, if it flies."""
        goal = self._pilot.destination
        place = goal or self._pilot.place()
        flies_there = may_fly_on or goal is not None
        return messages.request_for_place(self._node_id, to, place, flies_there=flies_there)
