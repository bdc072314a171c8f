"""The air: frames on their way from one chip to the others.

A frame is received by chips that listened on its channel and rate from before its start to its end.
Two frames that overlap on one channel destroy each other at a receiver, unless one is stronger by
the capture ratio; noise destroys them in the same way (space.py). Neighbouring channels do not
interfere, and the speed of light is infinite.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Callable, Protocol, Sequence

from drone_mesh.nrf24.emulator.clock import EmulatorClock
from drone_mesh.nrf24.emulator.frames import Frame
from drone_mesh.nrf24.emulator.links import Hop, LinkModel
from drone_mesh.nrf24.emulator.space import Position, Space
from drone_mesh.nrf24.registers import NS_PER_S

CAPTURE_DB = {250_000: 12.0, 1_000_000: 9.0, 2_000_000: 7.0}  # co-channel C/I [DS 5.7]
RPD_DBM = -64.0  # [DS 6.4]
RPD_NS = 40_000  # the least duration of power that is detected [DS 6.4]


class Antenna(Protocol):
    """A chip as seen by the air."""

    name: str
    position: Position
    listening_since_ns: int | None  # None: it does not listen

    def recognises(self, frame: Frame) -> bool:
        """Whether the frame starts with an address that the chip is listening for."""

    def frame_arrived(self, frame: Frame, power_dbm: float) -> None:
        """A recognised frame has ended; its bits may be damaged."""

    def frame_left(self) -> None:
        """The chip's own frame has ended."""


@dataclass(eq=False)
class Transmission:
    """One frame on the air."""

    sender: Antenna
    frame: Frame
    channel: int
    bits_per_s: int
    tx_dbm: float
    start_ns: int
    end_ns: int
    packet: object  # see links.Hop
    listeners: Sequence[Antenna]
    others: list[Transmission]  # overlapping frames on the channel
    aborted: bool = False


TransmissionObserver = Callable[[Transmission], None]


class Air:
    """One shared medium. Its state belongs to the holder of the clock's access."""

    def __init__(self, clock: EmulatorClock, links: LinkModel, rng: random.Random) -> None:
        self.clock = clock
        self.space = Space(links)
        self._rng = rng  # decides which bits of a damaged frame are wrong
        self._listening: dict[tuple[int, int], dict[Antenna, None]] = {}
        self._on_channel: dict[int, list[Transmission]] = {}
        self._pairs: dict[tuple[Antenna, Antenna], tuple[float, float]] = {}  # metres, lost dB
        self._observers: list[TransmissionObserver] = []
        self.frames = 0  # frames sent so far
        self.airtime_s = 0.0  # of all frames together
        self.collisions = 0  # frames that a receiver lost because of another frame

    def observe(self, observer: TransmissionObserver) -> None:
        """Call `observer` with each frame at its end."""
        self._observers.append(observer)

    def moved(self) -> None:
        self._pairs.clear()

    def listen(self, antenna: Antenna, channel: int, bits_per_s: int) -> None:
        """The antenna receives frames that start from now on."""
        antenna.listening_since_ns = self.clock.now_ns
        self._listening.setdefault((channel, bits_per_s), {})[antenna] = None

    def stop_listening(self, antenna: Antenna, channel: int, bits_per_s: int) -> None:
        """The antenna receives no more frames, nor the current one."""
        antenna.listening_since_ns = None
        self._listening[channel, bits_per_s].pop(antenna, None)

    def transmit(
        self, sender: Antenna, frame: Frame, radio: tuple[int, int, float], packet: object
    ) -> Transmission:
        """Start sending a frame now; `radio`: channel, bits per second, dBm."""
        start_ns = self.clock.now_ns
        end_ns = start_ns + frame.bit_count * 1_000_000_000 // radio[1]
        listeners = tuple(self._listening.get(radio[:2], ()))
        active = self._on_channel.setdefault(radio[0], [])
        transmission = Transmission(
            sender, frame, *radio, start_ns, end_ns, packet, listeners, others=list(active)
        )
        for other in active:
            other.others.append(transmission)
        active.append(transmission)
        self.clock.call_at(end_ns, self._end, transmission)
        return transmission

    def abort(self, transmission: Transmission) -> None:
        """The sender lost power during the frame, so no receiver can decode it."""
        transmission.aborted = True
        transmission.end_ns = self.clock.now_ns
        self._on_channel[transmission.channel].remove(transmission)

    def energy_dbm(self, antenna: Antenna, channel: int, bits_per_s: int, since_ns: int) -> float:
        """Power of what is strongest on the channel and lasted long enough to be detected."""
        now_ns = self.clock.now_ns
        enough_ns = now_ns - RPD_NS
        noise_dbm = -math.inf
        if self.space.noises and since_ns <= enough_ns:
            span_ns = (enough_ns, now_ns)
            noise_dbm = self.space.noise_dbm(
                antenna.position, 2400 + channel, bits_per_s, span_ns, throughout=True
            )
        frames_dbm = max(
            (
                self._power_dbm(transmission, antenna)
                for transmission in self._on_channel.get(channel, ())
                if transmission.sender is not antenna
                and max(transmission.start_ns, since_ns) <= enough_ns
            ),
            default=-math.inf,
        )
        return max(noise_dbm, frames_dbm)

    def recognised_until_ns(self, antenna: Antenna, channel: int, address_bits: int) -> int | None:
        """End of a frame that the antenna has recognised, whose address has passed; else None."""
        since_ns = antenna.listening_since_ns
        for transmission in self._on_channel.get(channel, ()):
            passed_ns = (
                transmission.start_ns + address_bits * 1_000_000_000 // transmission.bits_per_s
            )
            if (
                since_ns is not None
                and antenna in transmission.listeners
                and since_ns <= transmission.start_ns
                and passed_ns <= self.clock.now_ns
                and antenna.recognises(transmission.frame)
            ):
                return transmission.end_ns
        return None

    def _end(self, transmission: Transmission) -> None:
        for observer in self._observers:
            observer(transmission)
        if transmission.aborted:
            return
        self.frames += 1
        self.airtime_s += (transmission.end_ns - transmission.start_ns) / NS_PER_S
        self._on_channel[transmission.channel].remove(transmission)
        # The sender first: it must be listening when the answer to its frame starts.
        transmission.sender.frame_left()
        for antenna in transmission.listeners:
            since_ns = antenna.listening_since_ns
            if since_ns is None or since_ns > transmission.start_ns:
                continue
            if antenna.recognises(transmission.frame):
                self._arrive(transmission, antenna)

    def _arrive(self, transmission: Transmission, antenna: Antenna) -> None:
        power_dbm = self._power_dbm(transmission, antenna)
        if power_dbm == -math.inf:
            return  # obstacles block it
        bit_count = transmission.frame.bit_count
        errors = self.space.links.bit_errors(
            Hop(
                transmission.sender.name,
                antenna.name,
                self._pair(transmission.sender, antenna)[0],
                power_dbm,
                transmission.bits_per_s,
                bit_count,
                transmission.packet,
                transmission.start_ns,
            )
        )
        if errors is None:
            return
        needed_dbm = power_dbm - CAPTURE_DB[transmission.bits_per_s]
        if any(
            self._power_dbm(other, antenna) > needed_dbm for other in transmission.others
        ) or self._noise_exceeds(needed_dbm, transmission, antenna):
            self.collisions += 1
            return
        frame = transmission.frame
        if errors:
            frame = frame.with_errors(*self._rng.sample(range(bit_count), min(errors, bit_count)))
            if not antenna.recognises(frame):
                return
        antenna.frame_arrived(frame, power_dbm)

    def _power_dbm(self, transmission: Transmission, antenna: Antenna) -> float:
        if transmission.sender is antenna:
            return -math.inf  # its own frame, during which it did not listen
        sender, mhz = transmission.sender, 2400 + transmission.channel
        distance_m, lost_db = self._pair(sender, antenna)
        space = self.space
        power_dbm = space.links.received_dbm(distance_m, transmission.tx_dbm, mhz) - lost_db
        if space.fading is None:
            return power_dbm
        ends, places = (sender.name, antenna.name), (sender.position, antenna.position)
        return power_dbm + space.fading.gain_db(ends, places, mhz, self.clock.now_ns)

    def _noise_exceeds(self, dbm: float, transmission: Transmission, antenna: Antenna) -> bool:
        """Whether there was more noise than that at some time during the frame."""
        space = self.space
        if not space.noises:
            return False
        mhz, span_ns = 2400 + transmission.channel, (transmission.start_ns, transmission.end_ns)
        noise_dbm = space.noise_dbm(antenna.position, mhz, transmission.bits_per_s, span_ns)
        return noise_dbm > dbm

    def _pair(self, one: Antenna, other: Antenna) -> tuple[float, float]:
        """Distance of two antennas (m), and attenuation by obstacles between them (dB)."""
        pair = self._pairs.get((one, other))
        if pair is None:
            here, there = one.position, other.position
            pair = (math.dist(here, there), self.space.lost_db(here, there))
            self._pairs[one, other] = pair
        return pair
