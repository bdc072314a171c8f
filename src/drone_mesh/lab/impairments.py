"""What a run does to packets: counts, losses per link, jammed circles, one-way links."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from typing import Callable, Hashable

from drone_mesh.channel.packet_queue import OutgoingPacket
from drone_mesh.communication.wire import messages
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.radio import InProcessAir
from drone_mesh.inprocess.shared_air import SharedAir
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.scenario_parts import Jam
from drone_mesh.nrf24.emulator.links import OUTDOORS, Hop

_FREE_SPACE = 2.0  # exponent of the path loss, as in IdealDisc


class OneWay:
    """The radios of one run that are mute, deaf or weak: who hears whom if distance allows it."""

    def __init__(self, scenario: Scenario, streams: Streams) -> None:
        """Draw how much shorter each node's range is."""
        self.mute: set[int] = set()  # these send nothing
        self.deaf: set[int] = set()  # and these receive nothing
        self._reach_m: dict[int, float] = {}
        most_db, rng = scenario.radio.asymmetry_db, streams.generator("asymmetry")
        faded = scenario.obstacles.fading != "none"
        exponent = OUTDOORS if scenario.radio.links == "distance" or faded else _FREE_SPACE
        for node in range(MAX_DRONES if most_db else 0):
            less_db = rng.uniform(0.0, most_db)
            self._reach_m[node] = scenario.range_m * 10 ** (-less_db / (10 * exponent))
        acted = {fault.action for fault in scenario.faults} & {"mute", "deaf"}
        incidents = () if scenario.sequence is None else scenario.sequence.incidents
        self.occurs = bool(most_db or acted or {"goes_mute", "goes_deaf"} & set(incidents))
        self._network: Network | None = None

    def put(self, network: Network) -> None:
        """Tell the air who hears whom, if any link may work one way only."""
        self._network = network
        if self.occurs:
            network.air.hears = self.hears

    def hears(self, sender: int, receiver: int) -> bool:
        """Whether the receiver hears the sender, if they are in range of each other."""
        if sender in self.mute or receiver in self.deaf:
            return False
        reach_m, network = self._reach_m.get(sender), self._network
        if reach_m is None or network is None or not {sender, receiver} <= network.nodes.keys():
            return True
        return network.location(sender).distance_m(network.location(receiver)) < reach_m

    def loses(self, hop: Hop) -> bool:
        """Whether a frame on a shared channel is lost for that."""
        return not self.hears(_node(hop.sender), _node(hop.receiver))


def _node(name: Hashable) -> int:
    """The id of a radio; an emulated chip has a name that ends in it."""
    return int(str(name).rpartition(" ")[2])


@dataclass
class Traffic:
    """Packets of one type that were passed to the radio."""

    own: int = 0
    forwarded: int = 0


@dataclass
class Impairments:
    """Counts the packets that are handed to the air, and loses some.

    The n-th packet from one drone to another has the same fate in every cell of an experiment,
    whatever is sent elsewhere, because each link has its own random stream.
    """

    network: Network
    stream: Callable[[str], random.Random]
    loss: float
    one_way: OneWay
    traffic: dict[int, Traffic] = field(default_factory=dict)  # by type
    lost: int = 0
    jams: list[Jam] = field(default_factory=list)
    sent_by: dict[int, int] = field(default_factory=dict)
    frames: dict[str, int] | None = None  # on the shared channel: "control" and "data"
    arrives: Callable[[Location, Location], float] | None = None  # share, by fading

    def __post_init__(self) -> None:
        self._links: dict[tuple[int, int], random.Random] = {}
        air = self.network.air
        self.one_way.put(self.network)
        if isinstance(air, InProcessAir):
            air.carries = self.carries
        else:
            air.on_packet = self._count
            if isinstance(air, SharedAir):
                self.frames = {"control": 0, "data": 0}
                air.on_frame = self._count_frame

    @property
    def disc(self) -> InProcessAir:
        """The air; cuts, jams and losses exist only on the disc, as the file's check ensures."""
        assert isinstance(self.network.air, InProcessAir)
        return self.network.air

    def _count_frame(self, packet: OutgoingPacket) -> None:
        """Count a frame on the air; tries and acknowledgements are frames of their packet."""
        assert self.frames is not None
        self.frames["data" if messages.is_data(packet.payload) else "control"] += 1

    def carries(self, payload: bytes) -> bool:
        """Whether a packet is not lost."""
        sender, to = self._count(payload)
        if (self.loss or self.jams or self.arrives) and self._is_lost(sender, to):
            self.lost += 1
            return False
        return True

    def _count(self, payload: bytes) -> tuple[int, int]:
        """Count a packet; returns sender and receiver of this hop."""
        creator, sender, kind, to, _forward = messages.header(payload)
        counted = self.traffic.get(kind)
        if counted is None:
            counted = self.traffic[kind] = Traffic()
        if creator == sender:
            counted.own += 1
        else:
            counted.forwarded += 1
            self.sent_by[sender] = self.sent_by.get(sender, 0) + 1
        return sender, to

    def _is_lost(self, sender: int, to: int) -> bool:
        loss = self.loss
        for jam in self.jams:
            if self._is_inside(jam, sender) or self._is_inside(jam, to):
                loss = 1.0 - (1.0 - loss) * (1.0 - jam.loss)
        if self.arrives is not None and to in self.network.nodes:
            loss = 1.0 - (1.0 - loss) * self.arrives(*map(self.network.location, (sender, to)))
        if not loss:
            return False
        link = (sender, to)
        rng = self._links.get(link)
        if rng is None:
            rng = self._links[link] = self.stream(f"loss {sender} {to}")
        return rng.random() < loss

    def _is_inside(self, jam: Jam, node_id: int) -> bool:
        node = self.network.nodes.get(node_id)
        if node is None:
            return False
        place = node.drone.get_location()
        return math.dist((place.longitude, place.latitude), jam.center) < jam.radius_m
