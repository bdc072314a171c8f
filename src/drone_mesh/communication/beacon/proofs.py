"""Proofs: what a node with a key exchanges with its gateway because beacons prove nothing.

Heartbeats tell the nonces that seals need, and the gateway is asked for its place.

docs/security.md, "End-to-end seal".
"""

from __future__ import annotations

import math
import random

from drone_mesh.communication.beacon.courier import Courier
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.trickle import JITTER
from drone_mesh.communication.control.places import KnownPlaces, PlaceRequests
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals
from drone_mesh.communication.wire import messages

ASKS_S = 10.0  # at most so often for the place of a gateway that moves
PERIOD_S = 60.0  # a router and its gateway tell each other the nonces of their seals
AGAIN_S = 5.0  # until the gateway has answered twice


class Proofs:
    """When this node sends its gateway a heartbeat or a question, and its answers as a gateway.

    Orders and reports need the nonces; nothing else in a mesh with beacons depends on heartbeats.
    """

    def __init__(
        self,
        node_id: int,
        is_gateway: bool,
        routes: BeaconRoutes,
        courier: Courier,
        requests: PlaceRequests,
        places: KnownPlaces,
        seals: IMeshSeals,
        complaints: Complaints,
        rng: random.Random,
    ) -> None:
        self._node_id, self._is_gateway = node_id, is_gateway
        self._routes, self._courier, self._requests = routes, courier, requests
        self._places, self._complaints, self._rng = places, complaints, rng
        self._seals = seals
        self.has_key = seals.has_key
        self.due_s = math.inf  # the next heartbeat
        self._asked_s, self._ask_s = -math.inf, math.inf  # for the place of the gateway: last, next
        self._proven: int | None = None  # the gateway that answered the last one

    def begin(self) -> None:
        """Begin anew for another gateway, at a random moment: many nodes find it at once."""
        if self.has_key and not self._routes.is_root:
            self.due_s = self._routes.now_s + AGAIN_S * self._rng.random()

    def connected(self) -> None:
        """A gateway is reached."""
        if self.due_s == math.inf:
            self.begin()

    def ask_soon(self) -> None:
        """A beacon tells another place of the gateway than it told itself."""
        now_s = self._routes.now_s
        if self._ask_s == math.inf and now_s - self._asked_s >= ASKS_S:
            self._ask_s = now_s + AGAIN_S * self._rng.random()  # others hear the same

    @property
    def next_s(self) -> float:
        """When to call `on_time` next."""
        return min(self.due_s, self._ask_s)

    def _ask(self) -> None:
        self._asked_s, self._ask_s = self._routes.now_s, math.inf
        self._requests.ask(self._routes.gateway)

    def on_time(self) -> None:
        """Do what is due."""
        now_s = self._routes.now_s
        if now_s >= self._ask_s:
            self._ask()
        if now_s < self.due_s:
            return
        me, gateway = self._node_id, self._routes.gateway
        if self._routes.parent == NO_ROUTE:
            self.due_s = math.inf
            return
        self.due_s = now_s + AGAIN_S * (1.0 + self._rng.random())
        self._routes.tried[gateway] += not self._seals.may_be_gateway(gateway)
        self._courier.send_own(messages.heartbeat(me, me, gateway, gateway, True, gateway))
        if self._places.asks_gateway:
            self._ask()

    def heard(self, payload: bytes, creator: int) -> None:
        """A node tells this gateway its nonce, or the gateway answers."""
        now_s, me = self._routes.now_s, self._node_id
        if not self.has_key:
            self._complaints.dropped("a heartbeat of another technique", payload, now_s)
        elif messages.preferred_gateway(payload) != creator:  # gateways do not answer each other
            if self._is_gateway:
                self._courier.send_own(messages.heartbeat(me, me, creator, creator, True, me))
        elif creator == self._routes.gateway:
            if self._proven == creator:  # its second answer: by now it has a proof of this node
                self.due_s = now_s + PERIOD_S * (1.0 - JITTER * self._rng.random())
            self._proven = creator
