"""Dsdv: destination-sequenced distance vectors (Perkins and Bhagwat, SIGCOMM 1994).

Only gateways are destinations: entries for all nodes would not fit the bytes that PRESENT has
left, and the routes back are learned from heartbeats as in the tree.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.techniques.gateway_routes import GatewayRoutes, newer_by
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

ENTRY = struct.Struct("<BHB")  # gateway + 1 (0: no entry), sequence number, hops
INFINITE_HOPS = 255  # with an odd sequence number: the route is broken
SETTLING_S = 0.2  # changes within this time share one advertisement


class Entry(NamedTuple):
    """The route to one gateway."""

    sequence: int  # even ones are made by the gateway, odd ones mark a broken route
    hops: int
    next_hop: int


class Dsdv(GatewayRoutes):
    """The newest sequence number wins; of equal ones the fewest hops."""

    def __init__(self) -> None:
        super().__init__()
        self._vectors: dict[int, Entry] = {}  # by gateway
        self._own_sequence = 0

    def maintain_routing(self) -> None:
        """A gateway increments its sequence number; all nodes advertise."""
        self._own_sequence = (self._own_sequence + 2) % 2**16
        super().maintain_routing()

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        if kind == MessageType.PRESENT:
            extension = messages.extension(payload)
            for at in range(0, len(extension) - ENTRY.size + 1, ENTRY.size):
                gateway, sequence, hops = ENTRY.unpack_from(extension, at)
                if gateway:
                    self._hear(gateway - 1, Entry(sequence, hops, from_))
        return super().learn(creator, from_, kind, payload)

    def extension(self, kind: int, room: int) -> bytes:
        """The entries that fit into a PRESENT; a gateway's first is its own."""
        if kind != MessageType.PRESENT:
            return b""
        entries = dict(self._vectors)
        me = self._essentials.get_node_id()
        if self._essentials.get_preferred_gateway() == me:
            entries = {me: Entry(self._own_sequence, 0, me), **entries}
        packed = [ENTRY.pack(gateway + 1, e.sequence, e.hops) for gateway, e in entries.items()]
        return b"".join(packed[: room // ENTRY.size])

    def next_hop_to_gateway(self, gateway: int) -> int:
        entry = self._vectors.get(gateway)
        return NO_ROUTE if entry is None or entry.hops == INFINITE_HOPS else entry.next_hop

    def forget_neighbour(self, neighbour: int) -> None:
        for gateway, entry in self._vectors.items():
            if entry.next_hop == neighbour and entry.hops != INFINITE_HOPS:
                self._break(gateway, entry)

    def forget_gateway(self, gateway: int) -> None:
        entry = self._vectors.get(gateway)
        if entry is not None and entry.hops != INFINITE_HOPS:
            self._break(gateway, entry)

    def _hear(self, gateway: int, heard: Entry) -> None:
        if gateway == self._essentials.get_node_id():
            return
        known = self._vectors.get(gateway)
        new = heard._replace(hops=min(heard.hops + 1, INFINITE_HOPS))
        age = 1 if known is None else newer_by(heard.sequence, known.sequence)
        broken = new.hops == INFINITE_HOPS
        if broken and (known is None or known.next_hop != heard.next_hop):
            return  # about a route that this node does not use
        if known is None or age > 0 or (age == 0 and new.hops < known.hops):
            self._vectors[gateway] = new
            if known is None or (known.hops == INFINITE_HOPS) != broken:
                self._advertise_soon()

    def _break(self, gateway: int, entry: Entry) -> None:
        self._vectors[gateway] = Entry((entry.sequence + 1) % 2**16, INFINITE_HOPS, entry.next_hop)
        self._advertise_soon()

    def _advertise_soon(self) -> None:
        self._essentials.wake_at(self._essentials.now_s() + SETTLING_S)
