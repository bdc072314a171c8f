"""Babel: loop-free distance vectors with a feasibility condition (RFC 8966), for gateways.

Hello and IHU are not needed: the radio acknowledges, so the cost of a link is its ETX. The routes
back are learned from heartbeats as in the tree.
"""

from __future__ import annotations

import struct

from drone_mesh.communication import messages
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.communication.routing.techniques.feasible_routes import Distance, FeasibleRoutes
from drone_mesh.communication.routing.techniques.gateway_routes import GatewayRoutes

UPDATE = struct.Struct("<BHH")  # gateway + 1 (0: no update), sequence number, metric
REQUEST = struct.Struct("<BHB")  # gateway, the sequence number that is needed, hops left
REQUEST_TYPE = 8
REQUEST_HOPS = 32  # our choice; RFC 8966, 3.8.1.2 wants a limit
SOON_S = 0.2  # our choice: urgent updates within this time share one packet


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
