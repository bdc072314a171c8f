"""EtxTree: the tree of RPL with MRHOF (RFC 6550, RFC 6719), close to CTP (TinyOS TEP 123)."""

from __future__ import annotations

import struct
from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.techniques.gateway_routes import GatewayRoutes
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

RANK_PER_ETX = 128  # RFC 6719: ranks are ETX in units of 1/128
ROOT_RANK = 128  # RFC 6550, MinHopRankIncrease; 0 means that no rank is advertised
SWITCH_BELOW = 192  # RFC 6719, PARENT_SWITCH_THRESHOLD: 1.5 transmissions
MAX_RANK = 2**16 - 1
ADVERTISEMENT = struct.Struct("<BH")  # gateway, rank
SOLICITATION_TYPE = 10  # RFC 6550 calls it DIS
SOON_S = 0.2  # one advertisement answers all solicitations within this time


class Advertisement(NamedTuple):
    """The rank that a neighbour last announced, for one gateway."""

    gateway: int
    rank: int


class EtxTree(GatewayRoutes):
    """Each node advertises its path ETX in PRESENT, and uses the neighbour with the lowest sum."""

    def __init__(self) -> None:
        super().__init__()
        self._advertised: dict[int, Advertisement] = {}  # by neighbour
        self._parents: dict[int, int] = {}  # by gateway

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        if kind == MessageType.PRESENT:
            gateway, rank = ADVERTISEMENT.unpack_from(messages.extension(payload))
            if rank:
                self._advertised[from_] = Advertisement(gateway, rank)
            else:
                self._advertised.pop(from_, None)
        return super().learn(creator, from_, kind, payload)

    def extension(self, kind: int, room: int) -> bytes:
        if kind != MessageType.PRESENT:
            return b""
        gateway = self._essentials.get_preferred_gateway()
        rank = self._rank(gateway)
        return ADVERTISEMENT.pack(gateway, rank) if rank else b""

    def on_packet(self, creator: int, from_: int, kind: int, body: bytes) -> None:
        """A neighbour has no parent: advertise soon, if that helps."""
        if kind == SOLICITATION_TYPE:
            gateway = self._essentials.get_preferred_gateway()
            if self._rank(gateway) and self.next_hop_to_gateway(gateway) != from_:
                self._essentials.wake_at(self._essentials.now_s() + SOON_S)

    def next_hop_to_gateway(self, gateway: int) -> int:
        """The parent, replaced only by one that is better by SWITCH_BELOW."""
        costs = {
            neighbour: advertised.rank + RANK_PER_ETX * self.etx(neighbour)
            for neighbour, advertised in self._advertised.items()
            if advertised.gateway == gateway
        }
        if not costs:
            self._parents.pop(gateway, None)
            return NO_ROUTE
        best = min(costs, key=lambda neighbour: (costs[neighbour], neighbour))
        parent = self._parents.get(gateway)
        if parent not in costs or costs[best] < costs[parent] - SWITCH_BELOW:
            self._parents[gateway] = parent = best
        return parent

    def forget_neighbour(self, neighbour: int) -> None:
        """Drop its advertisement; solicit others if it was the last one."""
        advertised = self._advertised.pop(neighbour, None)
        if advertised is not None and self.next_hop_to_gateway(advertised.gateway) == NO_ROUTE:
            self._solicit()

    def forget_gateway(self, gateway: int) -> None:
        for neighbour in [
            n for n, advertised in self._advertised.items() if advertised.gateway == gateway
        ]:
            del self._advertised[neighbour]
        self._solicit()

    def _solicit(self) -> None:
        self._essentials.broadcast_packet(SOLICITATION_TYPE, b"")

    def _rank(self, gateway: int) -> int:
        if not self._essentials.get_connected_to_gateway():
            return 0  # otherwise nodes without a gateway would raise each other's ranks for ever
        if gateway == self._essentials.get_node_id():
            return ROOT_RANK
        parent = self.next_hop_to_gateway(gateway)
        if parent == NO_ROUTE:
            return 0
        rank = self._advertised[parent].rank + RANK_PER_ETX * self.etx(parent)
        return min(round(rank), MAX_RANK)
