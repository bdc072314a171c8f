"""The shared channel, packet by packet: a fast model of nRF24L01+ radios on one air.

It models what decides the fate of a packet: the duration of frames, half-duplex radios,
acknowledgements and their loss, overlapping frames (with capture), the FIFO of three payloads, and
the rules by which the driver uses the channel. These rules are the driver's own code
(`nrf24.medium_access`), and the link models are the emulator's (`nrf24.emulator.links`). It omits
the chip: registers, SPI and bits. `experiments/model.yaml` compares it with the
emulator.
"""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass, field
from typing import Callable, Final, Iterable, Tuple

import numpy as np

from drone_mesh.channel.packet_queue import ALL_NODES, OutgoingPacket
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location, metres_between
from drone_mesh.inprocess.clock import VirtualClock
from drone_mesh.inprocess.close_pairs import Surroundings, by_axis
from drone_mesh.inprocess.interfaces import IInProcessAir, IInProcessAntenna
from drone_mesh.nrf24.emulator.air import CAPTURE_DB, RPD_DBM, RPD_NS
from drone_mesh.nrf24.emulator.links import Hop, LinkModel
from drone_mesh.nrf24.emulator.space import Space
from drone_mesh.nrf24.registers import NS_PER_S
from drone_mesh.nrf24.settings import RadioSettings

MARGIN: Final = 0.05  # of the reach: the link model is asked about each radio in it
ROUNDED: Final = 1.000001  # factor on a distance: more than its last digits
MOST_GAIN_DB: Final = 10.0  # Rayleigh fading exceeds it once in 22,000 blocks

Link = Tuple[float, float]
"""From one radio to another, without fading: metres, dBm."""


@dataclass(eq=False)
class Transmission:
    """One frame on the air."""

    sender: SharedRadio
    packet: OutgoingPacket
    answers: SharedRadio | None  # an acknowledgement for that radio; None: the packet itself
    start_s: float
    start_ns: int
    end_s: float
    others: list[Transmission]  # that overlap with it
    readers: list[SharedRadio] = field(default_factory=list)  # whose drivers are about to read it


class SharedRadio(IInProcessAntenna):
    """A radio as seen by the air."""

    node_id: int
    drone: IDroneEngine
    powered: bool
    listening_since_s: float | None  # None: it sends, switches over or has no power

    @abc.abstractmethod
    def recognises(self, frame: Transmission) -> bool:
        """Whether the radio now listens for the address of that frame."""

    @abc.abstractmethod
    def frame_left(self, frame: Transmission) -> None:
        """The radio's own frame has ended."""

    @abc.abstractmethod
    def frame_arrived(self, frame: Transmission) -> None:
        """A frame for this radio has arrived undamaged."""

    @abc.abstractmethod
    def read(self, frame: Transmission) -> None:
        """The driver reads the payload of a frame that has arrived."""


class SharedAir(IInProcessAir):
    """All radios on one channel, and the frames between them."""

    clock: VirtualClock
    delivered = 0  # payloads so far that reached a mesh component

    def __init__(
        self,
        clock: VirtualClock,
        links: LinkModel,
        settings: RadioSettings,
        max_distance_m: float,
    ) -> None:
        """`max_distance_m`: the range for pictures and path searches."""
        self.clock = clock
        self.space = Space(links)
        self.settings = settings
        self.max_distance_m = max_distance_m
        self.frames = 0  # frames sent so far
        self.collisions = 0  # receptions that another frame destroyed
        self.airtime_s = 0.0  # of all frames together
        # Called with the packet of each frame that begins; set by experiments.
        self.on_frame: Callable[[OutgoingPacket], object] = id
        self._bits_per_s = settings.data_rate.value
        self._carrier_mhz = 2400 + settings.channel
        self._sent_dbm = float(settings.power.value)
        self._capture_db = CAPTURE_DB[self._bits_per_s]
        self._packet_s = settings.frame_s
        self._answer_s = settings.answer_frame_s
        self._packet_bits = round(self._packet_s * self._bits_per_s)
        self._answer_bits = round(self._answer_s * self._bits_per_s)
        self._radios: dict[int, SharedRadio] = {}
        self._active: list[Transmission] = []
        # What depends on places, until a radio moves: sender, receiver, of pairs at rest; in reach.
        self._links: dict[tuple[int, int], Link] = {}
        self._reached: dict[tuple[int, bool], list[SharedRadio]] = {}
        self._where: dict[int, Location] = {}  # of those at rest
        self._places: np.ndarray | None = None  # by_axis; those in flight may be anywhere: NaN
        self._listed: list[SharedRadio] = []  # in the order of these places
        self._row: dict[int, int] = {}  # of each radio in that list
        self._surroundings: dict[float, Surroundings] = {}  # by reach
        self._flying: set[int] = set()

    # The radios on the air -------------------------------------------------------------------

    def add(self, radio: SharedRadio) -> None:
        """Add a radio."""
        self._radios[radio.node_id] = radio
        self._forget(radio.node_id)

    def remove(self, radio: SharedRadio) -> None:
        """Remove a radio."""
        self._radios.pop(radio.node_id, None)
        self._forget(radio.node_id)

    def flight(self, node: int, started: bool) -> None:
        (self._flying.add if started else self._flying.discard)(node)
        self._forget(node)

    def moved(self, _nodes: Iterable[int]) -> None:
        self._reached.clear()
        self._links.clear()
        self._where.clear()
        self._places = None

    def in_range(self, node: int) -> dict[int, SharedRadio]:
        if node not in self._radios:
            return {}
        return {radio.node_id: radio for radio in self._in_reach(node, faded=False)}

    # Frames ----------------------------------------------------------------------------------

    def transmit(
        self, sender: SharedRadio, packet: OutgoingPacket, answers: SharedRadio | None = None
    ) -> None:
        """Start sending a frame now."""
        self.on_frame(packet)
        now_s = self.clock.now_s
        duration_s = self._packet_s if answers is None else self._answer_s
        others = list(self._active)
        start_ns, end_s = round(now_s * NS_PER_S), now_s + duration_s
        frame = Transmission(sender, packet, answers, now_s, start_ns, end_s, others)
        for other in others:
            other.others.append(frame)
        self._active.append(frame)
        self.airtime_s += duration_s
        self.clock.call_at(frame.end_s, self._end, frame)

    def _end(self, frame: Transmission) -> None:
        self.frames += 1
        self._active.remove(frame)
        frame.sender.frame_left(frame)
        if frame.answers is not None:
            self._arrive(frame, frame.answers)
        elif frame.packet.receiver != ALL_NODES:
            receiver = self._radios.get(frame.packet.receiver)
            if receiver is not None:
                self._arrive(frame, receiver)
        else:
            for receiver in self._in_reach(frame.sender.node_id, faded=True):
                self._arrive(frame, receiver)

    def _arrive(self, frame: Transmission, receiver: SharedRadio) -> None:
        since_s = receiver.listening_since_s
        if since_s is None or since_s > frame.start_s or not receiver.recognises(frame):
            return
        sender_id, receiver_id = frame.sender.node_id, receiver.node_id
        distance_m, power_dbm = self._link(sender_id, receiver_id)
        if power_dbm == -math.inf:
            return  # obstacles block it
        if self.space.fading is not None:
            power_dbm = self._faded_dbm(sender_id, receiver_id, power_dbm)
        hop = Hop(
            sender_id,
            receiver_id,
            distance_m,
            power_dbm,
            self._bits_per_s,
            self._packet_bits if frame.answers is None else self._answer_bits,
            frame.packet if frame.answers is None else None,
            frame.start_ns,
        )
        errors = self.space.links.bit_errors(hop)
        if errors is None:
            return
        if self.space.noises and self._noise_exceeds(power_dbm - self._capture_db, frame, receiver):
            self.collisions += 1
            return
        if frame.others:
            strongest_dbm = power_dbm - self._capture_db
            for other in frame.others:
                if self._power(other.sender.node_id, receiver_id) > strongest_dbm:
                    self.collisions += 1
                    return
        if errors == 0:
            receiver.frame_arrived(frame)

    # Places ----------------------------------------------------------------------------------

    def _forget(self, node: int) -> None:
        self._reached.clear()
        self._where.pop(node, None)
        self._places = None
        self._surroundings.clear()
        self._links = {pair: link for pair, link in self._links.items() if node not in pair}

    def _power(self, sender: int, receiver: int) -> float:
        """The power of a frame between two radios now."""
        _distance_m, power_dbm = self._link(sender, receiver)
        return self._faded_dbm(sender, receiver, power_dbm)

    def _faded_dbm(self, sender: int, receiver: int, power_dbm: float) -> float:
        fading = self.space.fading
        if fading is None or power_dbm == -math.inf:
            return power_dbm
        radios = self._radios
        here, there = (radios[end].drone.get_location() for end in (sender, receiver))
        places = here.to_vector(), there.to_vector()
        now_ns = round(self.clock.now_s * NS_PER_S)
        return power_dbm + fading.gain_db((sender, receiver), places, self._carrier_mhz, now_ns)

    def _link(self, sender: int, receiver: int) -> Link:
        link = self._links.get((sender, receiver))
        if link is None:
            link = self._measured(sender, receiver)
            if sender not in self._flying and receiver not in self._flying:
                self._links[sender, receiver] = link
        return link

    def _measured(self, sender: int, receiver: int) -> Link:
        radios = self._radios
        if sender == receiver or sender not in radios or receiver not in radios:
            return math.inf, -math.inf  # no link: to itself, or to a radio that is gone
        here, there, space = self._place(sender), self._place(receiver), self.space
        distance_m = metres_between(here, there)
        power_dbm = space.links.received_dbm(distance_m, self._sent_dbm, self._carrier_mhz)
        if space.obstacles is not None:
            power_dbm -= space.lost_db(here.to_vector(), there.to_vector())
        return distance_m, power_dbm

    def _place(self, node: int) -> Location:
        place = self._where.get(node)
        if place is None:
            place = self._radios[node].drone.get_location()
            if node not in self._flying:
                self._where[node] = place
        return place

    def _noise_exceeds(self, dbm: float, frame: Transmission, receiver: SharedRadio) -> bool:
        """Whether there was more noise than that at some time during the frame."""
        span_ns = (frame.start_ns, round(frame.end_s * NS_PER_S))
        place = receiver.drone.get_location().to_vector()
        noise_dbm = self.space.noise_dbm(place, self._carrier_mhz, self._bits_per_s, span_ns)
        return noise_dbm > dbm

    def hears_power(self, radio: SharedRadio) -> bool:
        """Whether noise or a frame of another radio is strong enough for RPD now."""
        now_ns = round(self.clock.now_s * NS_PER_S)
        strongest_dbm = self.space.noise_dbm(
            radio.drone.get_location().to_vector(),
            self._carrier_mhz,
            self._bits_per_s,
            (now_ns - RPD_NS, now_ns),
            throughout=True,
        )
        for frame in self._active:
            strongest_dbm = max(strongest_dbm, self._power(frame.sender.node_id, radio.node_id))
        return strongest_dbm > RPD_DBM

    def _in_reach(self, node: int, faded: bool) -> list[SharedRadio]:
        """The radios that may hear a node: on average, or when fading adds to the power."""
        faded = faded and self.space.fading is not None
        reached = self._reached.get((node, faded))
        if reached is None:
            more_db = MOST_GAIN_DB if faded else 0.0
            near = self._near(node, more_db)
            reached = [radio for radio in near if self._reaches(node, radio.node_id, more_db)]
            if not self._flying:
                self._reached[node, faded] = reached
        return reached

    def _near(self, node: int, more_db: float) -> list[SharedRadio]:
        """The radios in reach, and a few others: a quick choice among many."""
        if node not in self._radios:
            return []
        if self._places is None:
            unknown, flying = Location(math.nan, math.nan, math.nan), self._flying
            places = [unknown if other in flying else self._place(other) for other in self._radios]
            self._places = by_axis(places)
            self._listed = list(self._radios.values())
            self._row = {other: row for row, other in enumerate(self._radios)}
            for surroundings in self._surroundings.values():
                surroundings.follow(self._places)
        furthest_m = ROUNDED * self.space.links.furthest_m(
            self._sent_dbm, self._carrier_mhz, self._bits_per_s, more_db
        )
        if furthest_m not in self._surroundings:
            self._surroundings[furthest_m] = Surroundings(furthest_m, MARGIN, self._places)
        rows = self._surroundings[furthest_m].of(self._row[node])
        return [self._listed[row] for row in rows]

    def _reaches(self, node: int, other: int, more_db: float) -> bool:
        distance_m, power_dbm = self._link(node, other)
        return power_dbm > -math.inf and self.space.links.reaches(
            distance_m, power_dbm + more_db, self._bits_per_s
        )
