"""Batman: originator messages of gateways, flooded along the best paths (B.A.T.M.A.N. IV).

After the protocol of the Freifunk community (draft-openmesh-b-a-t-m-a-n-00, with the transmit
quality of version IV). Only gateways originate: 254 originators would fill the channel. The routes
back are learned from heartbeats as in the tree.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from typing import NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.techniques.gateway_routes import GatewayRoutes, newer_by

ORIGINATOR = struct.Struct("<BHBB")  # gateway, sequence number, transmit quality, hops left
ORIGINATOR_TYPE = 9
MAX_QUALITY = 255
HOP_PENALTY = 15  # of 255, as in the Linux implementation
WINDOW = 5  # number of sequence numbers in the mean of a neighbour's quality
HOPS = 50
ORIGINATE_EVERY_S = 5.0  # a check period holds two
SPREAD_S = 0.005  # neighbours repeat a message one after another
SLOTS = 16


class Heard(NamedTuple):
    """One originator message as received from a neighbour."""

    sequence: int
    quality: int


class Batman(GatewayRoutes):
    """The next hop to a gateway is the neighbour whose messages arrive best."""

    def __init__(self) -> None:
        super().__init__()
        self._heard: dict[int, dict[int, deque[Heard]]] = {}  # by gateway, by neighbour
        self._newest: dict[int, int] = {}  # by gateway: sequence number
        self._repeat: list[tuple[float, bytes]] = []
        self._sequence = 0
        self._originate_s = -math.inf

    def maintain_routing(self) -> None:
        """A gateway originates; all nodes check their neighbours as the tree does."""
        super().maintain_routing()
        if self._essentials.get_preferred_gateway() == self._essentials.get_node_id():
            self._originate()

    def on_packet(self, creator: int, from_: int, kind: int, body: bytes) -> None:
        """Record its quality, and repeat it if it came from the best neighbour."""
        if kind != ORIGINATOR_TYPE:
            return
        gateway, sequence, quality, hops_left = ORIGINATOR.unpack_from(body)
        me = self._essentials.get_node_id()
        age = newer_by(sequence, self._newest.get(gateway, sequence - 1))
        if gateway == me or age < 1 - WINDOW:
            return
        quality = round(quality / self.etx(from_)) * (MAX_QUALITY - HOP_PENALTY)
        quality //= MAX_QUALITY
        heard = self._heard.setdefault(gateway, {}).setdefault(from_, deque(maxlen=WINDOW))
        heard.append(Heard(sequence, quality))
        if age > 0:
            self._newest[gateway] = sequence
        if age > 0 and hops_left and self.next_hop_to_gateway(gateway) == from_:
            at_s = self._essentials.now_s() + SPREAD_S * (1 + me % SLOTS)
            repeated = ORIGINATOR.pack(gateway, sequence, quality, hops_left - 1)
            self._repeat.append((at_s, repeated))
            self._plan()

    def on_time(self, now_s: float) -> None:
        """Repeat due messages; a gateway originates again."""
        due = [repeated for at_s, repeated in self._repeat if at_s <= now_s]
        self._repeat = [(at_s, repeated) for at_s, repeated in self._repeat if at_s > now_s]
        for repeated in due:
            self._essentials.broadcast_packet(ORIGINATOR_TYPE, repeated)
        if now_s >= self._originate_s > -math.inf:
            self._originate()
        self._plan()

    def next_hop_to_gateway(self, gateway: int) -> int:
        """The neighbour with the best mean quality over the newest sequence numbers."""
        newest, qualities = self._newest.get(gateway, 0), {}
        for neighbour, heard in self._heard.get(gateway, {}).items():
            recent = [h.quality for h in heard if (newest - h.sequence) % 2**16 < WINDOW]
            if recent:
                qualities[neighbour] = sum(recent) / WINDOW
        if not qualities:
            return NO_ROUTE
        return max(qualities, key=lambda neighbour: (qualities[neighbour], -neighbour))

    def forget_neighbour(self, neighbour: int) -> None:
        for heard in self._heard.values():
            heard.pop(neighbour, None)

    def forget_gateway(self, gateway: int) -> None:
        self._heard.pop(gateway, None)

    def _originate(self) -> None:
        self._sequence = (self._sequence + 1) % 2**16
        packet = ORIGINATOR.pack(self._essentials.get_node_id(), self._sequence, MAX_QUALITY, HOPS)
        self._essentials.broadcast_packet(ORIGINATOR_TYPE, packet)
        self._originate_s = self._essentials.now_s() + ORIGINATE_EVERY_S
        self._plan()

    def _plan(self) -> None:
        times_s = [at_s for at_s, _repeated in self._repeat]
        if self._originate_s > -math.inf:
            times_s.append(self._originate_s)
        self._essentials.wake_at(min(times_s, default=math.inf))
