"""Stranger: a radio outside the mesh, or a captured node."""

from __future__ import annotations

import hashlib
import random
import struct
from collections import Counter
from typing import Callable, Iterator, NamedTuple

from drone_mesh.communication.interfaces import BROADCAST, IMeshNetwork, IWirelessCommunication
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.communication.seals.sealed_antenna import SealedAntenna
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import header
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.drone import InProcessDrone
from drone_mesh.inprocess.network import Network

_ANSWER = struct.Struct("<QQI")  # the nonce of the challenge, epoch, counter

BESIDE = 201  # a router of the stranger, without a key


class RecordedPacket(NamedTuple):
    """A packet as recorded on the air."""

    at_s: float
    receiver: int
    payload: bytes


class Tap(IMeshNetwork):
    """Records what a node hears, without changing it."""

    def __init__(self, network: Network, node_id: int, record: list[RecordedPacket]) -> None:
        self._network = network
        self._node_id = node_id
        self._record = record
        self.tapped = network.nodes[node_id].receiver

    def on_msg(self, payload: bytes, now_s: float) -> None:
        self._record.append(RecordedPacket(now_s, self._node_id, payload))
        self.tapped.on_msg(payload, now_s)

    def get_node_id(self) -> int:
        return self._node_id

    def on_delivered(self, payload: bytes, tries: int, now_s: float) -> None:
        self.tapped.on_delivered(payload, tries, now_s)

    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        self.tapped.on_undelivered(payload, tries, now_s)

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        self.tapped.on_antenna_power(on, now_s)

    def on_antenna_registered(self, now_s: float) -> None:
        self.tapped.on_antenna_registered(now_s)


class Hole(Tap):
    """A node of the mesh that forwards heartbeats and drops all other packets for other nodes."""

    def on_msg(self, payload: bytes, now_s: float) -> None:
        _creator, _from, kind, _to, forward = header(payload)
        if kind == MessageType.HEARTBEAT or forward in (self.get_node_id(), BROADCAST):
            self.tapped.on_msg(payload, now_s)


class Stranger(IMeshNetwork):
    """Records and forges packets at one position, over a radio that answers as `node_id`."""

    def __init__(self, network: Network, node_id: int, x: float, y: float) -> None:
        """At (x, y) metres on the ground, with a radio like those of the network."""
        self.node_id = node_id
        self.network = network
        self.mute = False  # True: it does nothing
        self.record: list[RecordedPacket] = []
        self.swallows: set[int] = set()  # nodes that drop packets for other nodes
        self.ordered: dict[int, Location] = {}  # where the owner sent drones during the attack
        self.on_packet: Callable[[bytes], object] = len  # called with packets to its own address
        self.drone = InProcessDrone(
            network.clock, Location.from_vector((x, y, 0.0)), lambda _started: None, ""
        )
        self._receiver: IMeshNetwork = self
        self._is_inside = False
        self._network_key = b"a guess"
        self._air = network.air
        rng = random.Random(f"stranger {node_id}")
        self.antenna: IWirelessCommunication = network.air.antenna(self, rng)

    def join_with(self, keys: Keys) -> None:
        """Send and receive with the keys of a captured node."""
        rng = random.Random(f"stranger {self.node_id}")
        clock = self.network.now_s
        self._is_inside = True
        self._network_key = keys.network
        self.antenna = sealed = SealedAntenna(self.antenna, self.node_id, keys, rng, clock)
        self._receiver = sealed

    def switch_on(self) -> None:
        """Become reachable."""
        self.antenna.start_antenna(self)

    def listen(self) -> None:
        """Start recording what the nodes in range hear."""
        for node_id in self.in_range():
            self.network.nodes[node_id].receiver = Tap(self.network, node_id, self.record)

    def swallow_as_relay(self) -> None:
        """Turn the router on most routes into a relay that swallows.

        In a mesh with a key, a radio without that key runs the mesh software beside the mesh.
        """
        if self.mute:
            return
        network = self.network
        if self._is_inside or not network.sealed:
            network.run_until(network.all_connected, within_s=60.0)
            relay = self.busiest_relay()
        else:
            relay = BESIDE
            x, y, _ = self.drone.get_location().to_vector()
            network.add_router(relay, x, y, network.now_s())
            network.run_for(0.0)
        node = network.nodes[relay]
        node.receiver = Hole(network, relay, [])
        self.swallows.add(relay)

    def busiest_relay(self) -> int:
        """The live router on most routes to the gateway."""
        nodes = self.network.nodes
        paths = map(self.network.path_to_gateway, nodes)
        relays = Counter(node for path in paths for node in (path or [])[1:-1])
        live = sorted(node for node in relays if nodes[node].antenna.powered)
        return max(live, key=relays.__getitem__)

    def in_range(self) -> list[int]:
        """The nodes that can hear it."""
        return sorted(self._air.in_range(self.node_id))

    def say(
        self, kind: int, creator: int, to: int, forward: int, body: bytes, relay: int | None = None
    ) -> None:
        """Hand the neighbour `to` a packet of `creator` that `relay` (default: it) seems to send.

        A captured node can pose as another sender in a broadcast only. Otherwise it has no key for
        that, and is the relay.
        """
        sender = creator if relay is None else relay
        if self._is_inside and forward == BROADCAST and sender in self.network.nodes:
            claim = messages.packet(kind, creator, sender, to, forward, body)
            self.play(to, self._sealed_as(sender, claim))
        elif self._is_inside and not self.mute:
            packet = messages.packet(kind, creator, self.node_id, to, forward, body)
            self.antenna.send_message_to(packet)
        else:
            self.play(to, messages.packet(kind, creator, sender, to, forward, body))

    def _sealed_as(self, node: int, payload: bytes) -> bytes:
        """A broadcast with the next count of this node, whose epoch and counts it has heard.

        So the node's own next one seems to have come before.
        """
        receiver = self.network.nodes[node].receiver
        while isinstance(receiver, Tap):
            receiver = receiver.tapped
        assert isinstance(receiver, SealedAntenna)
        seal = receiver._seal
        return self.sealed_to_all(payload, seal._epoch, seal._count + 1)

    def epochs(self) -> dict[int, tuple[int, int]]:
        """Epoch and counter of the nodes whose answers to challenges it has recorded."""
        known = {}
        for recorded in self.record:
            if recorded.payload[messages.TYPE_AT] == MessageType.SEAL_ANSWER:
                _nonce, epoch, count = _ANSWER.unpack_from(messages.body(recorded.payload))
                known[messages.sender(recorded.payload)] = epoch, count
        return known

    def sealed_to_all(self, payload: bytes, epoch: int, count: int) -> bytes:
        """A broadcast with the seal of docs/security.md; without its key a wrong one."""
        head = payload[: messages.TO_AT] + bytes((BROADCAST,))
        covered = head + payload[messages.FORWARD_AT : 25]
        tag = hashlib.blake2s(key=self._network_key, digest_size=5, person=b"hop")
        tag.update(struct.pack("<QI", epoch, count) + covered)
        return payload[:25] + struct.pack("<H", count % 2**16) + tag.digest()

    def play(self, receiver: int, payload: bytes) -> None:
        """Send bytes to one node."""
        if not self.mute and receiver in self._air.in_range(self.node_id):
            self.network.inject(receiver, payload)

    def every(self, period_s: float, seconds: float) -> Iterator[None]:
        """Yield once per period, while simulated time passes."""
        end_s = self.network.now_s() + seconds
        while self.network.now_s() < end_s:
            yield
            self.network.run_for(period_s)

    def targets(self, period_s: float, seconds: float) -> Iterator[int]:
        """Yield each node in range once per period, while simulated time passes."""
        for _ in self.every(period_s, seconds):
            yield from self.in_range()

    # IMeshNetwork ----------------------------------------------------------------------------

    def submit(self, work: Callable[[float], None]) -> None:
        work(self.network.now_s())

    def hear(self, payload: bytes) -> None:
        self._receiver.on_msg(payload, self.network.now_s())

    def on_msg(self, payload: bytes, now_s: float) -> None:
        self.on_packet(payload)

    def get_node_id(self) -> int:
        return self.node_id

    def on_delivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """Ignored."""

    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """Ignored."""

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        """Ignored."""

    def on_antenna_registered(self, now_s: float) -> None:
        """Ignored."""
