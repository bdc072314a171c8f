"""Babel: loop-free distance vectors with a feasibility condition (RFC 8966), for gateways.

Hello and IHU are not needed: the radio acknowledges, so the cost of a link is its ETX. The routes
back are learned from heartbeats as in the tree.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.techniques.gateway_routes import (
    GatewayRoutes,
    LinkCosts,
    newer_by,
)
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

UPDATE = struct.Struct("<BHH")  # gateway + 1 (0: no update), sequence number, metric
REQUEST = struct.Struct("<BHB")  # gateway, the sequence number that is needed, hops left
REQUEST_TYPE = 8
REQUEST_HOPS = 32  # RFC 8966, 3.8.1.2 wants a limit
SOON_S = 0.2  # urgent updates within this time share one packet
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


class Babel(GatewayRoutes):
    """Uses the cheapest of the neighbours that cannot be behind this node."""

    def __init__(self) -> None:
        super().__init__()
        self._routes = FeasibleRoutes(self.links)
        self._own_sequence = 0

    def maintain_routing(self) -> None:
        """A gateway increments its sequence number; all nodes advertise."""
        self._own_sequence = (self._own_sequence + 1) % 2**16
        super().maintain_routing()

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        """A PRESENT carries the updates of its creator."""
        if kind == MessageType.PRESENT:
            extension = messages.extension(payload)
            for at in range(0, len(extension) - UPDATE.size + 1, UPDATE.size):
                gateway, sequence, metric = UPDATE.unpack_from(extension, at)
                if gateway:
                    self._hear(gateway - 1, from_, Distance(sequence, metric))
        return super().learn(creator, from_, kind, payload)

    def extension(self, kind: int, room: int) -> bytes:
        """The updates that fit into a PRESENT."""
        if kind != MessageType.PRESENT or self._essentials is None:
            return b""
        me, packed = self._essentials.get_node_id(), []
        if self._essentials.get_preferred_gateway() == me:
            packed.append(UPDATE.pack(me + 1, self._own_sequence, 0))
        for gateway, update in self._routes.advertise():
            packed.append(UPDATE.pack(gateway + 1, *update))
        return b"".join(packed[: room // UPDATE.size])

    def next_hop_to_gateway(self, gateway: int) -> int:
        """The best feasible neighbour."""
        return self._routes.best(gateway)

    def forget_neighbour(self, neighbour: int) -> None:
        """Drop its updates; if no other route is left, advertise that soon."""
        for gateway in self._routes.forget_neighbour(neighbour):
            self._starve(gateway)

    def forget_gateway(self, gateway: int) -> None:
        """Drop all updates for it until they are repeated."""
        self._routes.forget_gateway(gateway)

    def on_packet(self, creator: int, from_: int, kind: int, body: bytes) -> None:
        """A starving node needs a new sequence number: create it, or forward the request."""
        if kind != REQUEST_TYPE or self._essentials is None:
            return
        gateway, sequence, hops_left = REQUEST.unpack_from(body)
        if gateway == self._essentials.get_node_id():
            if Distance(sequence, 0).better_than(Distance(self._own_sequence, 0)):
                self._own_sequence = sequence
                self._essentials.wake_at(self._essentials.now_s() + SOON_S)
        elif hops_left:
            to = self.next_hop_to_gateway(gateway)
            if to not in (NO_ROUTE, from_):
                again = REQUEST.pack(gateway, sequence, hops_left - 1)
                self._essentials.send_packet(REQUEST_TYPE, to, again)

    def _hear(self, gateway: int, neighbour: int, update: Distance) -> None:
        assert self._essentials is not None
        if gateway == self._essentials.get_node_id():
            return
        had_route = self.next_hop_to_gateway(gateway) != NO_ROUTE
        self._routes.hear(gateway, neighbour, update)
        has_route = self.next_hop_to_gateway(gateway) != NO_ROUTE
        if had_route and not has_route:
            self._starve(gateway)
        elif has_route and not had_route:
            self._essentials.wake_at(self._essentials.now_s() + SOON_S)

    def _starve(self, gateway: int) -> None:
        sequence = self._routes.needed_sequence(gateway)
        if self._essentials is None or sequence is None:
            return
        wanted = REQUEST.pack(gateway, sequence, REQUEST_HOPS)
        self._essentials.broadcast_packet(REQUEST_TYPE, wanted)
        self._essentials.wake_at(self._essentials.now_s() + SOON_S)
