"""Babel: loop-free distance vectors with a feasibility condition (RFC 8966), for gateways.

Hello and IHU are not needed: the radio acknowledges, so the cost of a link is its ETX. The routes
back are learned from heartbeats as in the tree.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.techniques.gateway_routes import GatewayRoutes, newer_by
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


class Babel(GatewayRoutes):
    """Uses the cheapest of the neighbours that cannot be behind this node."""

    def __init__(self) -> None:
        super().__init__()
        self._updates: dict[int, dict[int, Distance]] = {}  # by gateway, by neighbour
        self._feasibility: dict[int, Distance] = {}  # by gateway: the best ever advertised
        self._own_sequence = 0

    def maintain_routing(self) -> None:
        """A gateway increments its sequence number; all nodes advertise."""
        self._own_sequence = (self._own_sequence + 1) % 2**16
        super().maintain_routing()

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        if kind == MessageType.PRESENT:
            extension = messages.extension(payload)
            for at in range(0, len(extension) - UPDATE.size + 1, UPDATE.size):
                gateway, sequence, metric = UPDATE.unpack_from(extension, at)
                if gateway:
                    self._hear(gateway - 1, from_, Distance(sequence, metric))
        return super().learn(creator, from_, kind, payload)

    def extension(self, kind: int, room: int) -> bytes:
        if kind != MessageType.PRESENT:
            return b""
        me, packed = self._essentials.get_node_id(), []
        if self._essentials.get_preferred_gateway() == me:
            packed.append(UPDATE.pack(me + 1, self._own_sequence, 0))
        for gateway in self._updates:
            update = self._distance(gateway)
            packed.append(UPDATE.pack(gateway + 1, *update))
            if self._is_feasible(gateway, update):  # what is advertised bounds what is feasible
                self._feasibility[gateway] = update
        return b"".join(packed[: room // UPDATE.size])

    def next_hop_to_gateway(self, gateway: int) -> int:
        """The feasible neighbour with the smallest sum of its metric and the link's cost."""
        costs = {
            n: self._cost(n, update)
            for n, update in self._updates.get(gateway, {}).items()
            if self._is_feasible(gateway, update)
        }
        return min(costs, key=lambda n: (costs[n], n)) if costs else NO_ROUTE

    def forget_neighbour(self, neighbour: int) -> None:
        for gateway, updates in list(self._updates.items()):
            if updates.pop(neighbour, None) and self.next_hop_to_gateway(gateway) == NO_ROUTE:
                self._starve(gateway)

    def forget_gateway(self, gateway: int) -> None:
        self._updates.get(gateway, {}).clear()

    def on_packet(self, creator: int, from_: int, kind: int, body: bytes) -> None:
        """A starving node needs a new sequence number: create it, or forward the request."""
        if kind != REQUEST_TYPE:
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
        if gateway == self._essentials.get_node_id():
            return
        had_route = self.next_hop_to_gateway(gateway) != NO_ROUTE
        self._updates.setdefault(gateway, {})[neighbour] = update
        has_route = self.next_hop_to_gateway(gateway) != NO_ROUTE
        if had_route and not has_route:
            self._starve(gateway)
        elif has_route and not had_route:
            self._essentials.wake_at(self._essentials.now_s() + SOON_S)

    def _starve(self, gateway: int) -> None:
        """Ask for the sequence number that would make a route feasible again."""
        limit = self._feasibility.get(gateway)
        if limit is None:  # any would
            return
        wanted = REQUEST.pack(gateway, (limit.sequence + 1) % 2**16, REQUEST_HOPS)
        self._essentials.broadcast_packet(REQUEST_TYPE, wanted)
        self._essentials.wake_at(self._essentials.now_s() + SOON_S)

    def _is_feasible(self, gateway: int, update: Distance) -> bool:
        limit = self._feasibility.get(gateway)
        return update.metric != INFINITE and (limit is None or update.better_than(limit))

    def _distance(self, gateway: int) -> Distance:
        to = self.next_hop_to_gateway(gateway)
        if to == NO_ROUTE:
            limit = self._feasibility.get(gateway, Distance(0, INFINITE))
            return Distance(limit.sequence, INFINITE)
        update = self._updates[gateway][to]
        return Distance(update.sequence, self._cost(to, update))

    def _cost(self, neighbour: int, update: Distance) -> int:
        return min(update.metric + round(COST_PER_ETX * self.etx(neighbour)), INFINITE - 1)
