"""Space: what lies between antennas, and what else sends there.

Both airs, of the chips and of the fast model, get losses, fading and noise from it.

Fading is block fading: the gain of a link is constant for one coherence time, and then it is
another one. The coherence time is 0.423 / f_D (Rappaport, Wireless Communications, 1996, eq.
5.40.c). The Doppler spread f_D = (v1 + v2) / wavelength for two ends that both move (Akki and
Haber, A statistical model of mobile-to-mobile land communication channel, IEEE TVT 1986). Both
directions have the same gain.
"""

from __future__ import annotations

import math
import random
from collections import deque
from typing import Callable, Hashable, Tuple

from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.emulator.links import LinkModel
from drone_mesh.nrf24.registers import NS_PER_S

KINDS = ("rayleigh", "rician")
RICIAN_K_DB = 10.0
SPEED_OF_LIGHT_M_S = 299_792_458.0
COHERENCE = 0.423
STIRRING_M_S = 0.5  # leaves, people and propellers move where drones stand
_SPEED_OVER_NS = NS_PER_S // 10  # a speed is that of the last tenth of a second, or longer
_DEEPEST_DB = -60.0  # a finite number for a sum that is nearly zero

Position = Tuple[float, float, float]  # metres


class Fading:
    """The gains of all links of one air. Its state belongs to the holder of the clock's access."""

    def __init__(
        self,
        kind: str,
        rng: random.Random,
        *,
        k_db: float = 10.0,
        metres_per_metre: float = 1.0,
        stirring_m_s: float = STIRRING_M_S,
    ) -> None:
        """`kind`: "rayleigh" (no line of sight) or "rician", whose line-of-sight part has `k_db`
        more power than the rest. `metres_per_metre`: real metres for one of the world, if the world
        is a scaled one, so that speeds are real ones; `stirring_m_s`: what moves around each end.

        Raises ConfigurationError.
        """
        if kind not in KINDS:
            raise ConfigurationError(f"invalid fading {kind!r}: use {' or '.join(KINDS)}")
        k = 0.0 if kind == "rayleigh" else 10.0 ** (k_db / 10.0)
        self._line_of_sight = math.sqrt(k / (k + 1.0))
        self._scatter = math.sqrt(0.5 / (k + 1.0))  # standard deviation of each quadrature
        self._rng = rng
        self._scale = metres_per_metre
        self._stirring_m_s = stirring_m_s
        self._blocks: dict[tuple[Hashable, Hashable], tuple[int, float]] = {}  # until, gain
        self._seen: dict[Hashable, tuple[int, Position, float]] = {}  # when, where, speed

    def gain_db(
        self,
        ends: tuple[Hashable, Hashable],
        places: tuple[Position, Position],
        mhz: int,
        at_ns: int,
    ) -> float:
        """The gain of a link at this time; its mean, in power, is 1."""
        block = self._blocks.get(ends)
        if block is not None and at_ns < block[0]:
            return block[1]
        speed_m_s = sum(self._speed(end, place, at_ns) for end, place in zip(ends, places))
        until_ns = at_ns + self._coherence_ns(speed_m_s * self._scale + self._stirring_m_s, mhz)
        gain_db = self._draw_db()
        one, other = ends
        self._blocks[one, other] = self._blocks[other, one] = (until_ns, gain_db)
        return gain_db

    def _coherence_ns(self, speed_m_s: float, mhz: int) -> int:
        doppler_hz = speed_m_s * mhz * 1e6 / SPEED_OF_LIGHT_M_S
        return round(COHERENCE / max(doppler_hz, 1e-6) * NS_PER_S)

    def _draw_db(self) -> float:
        gauss = self._rng.gauss
        in_phase = self._line_of_sight + self._scatter * gauss(0.0, 1.0)
        power = in_phase**2 + (self._scatter * gauss(0.0, 1.0)) ** 2
        return max(10.0 * math.log10(max(power, 1e-9)), _DEEPEST_DB)

    def _speed(self, end: Hashable, place: Position, at_ns: int) -> float:
        """Metres of the world per second since it was last looked at."""
        seen = self._seen.get(end)
        if seen is None:
            self._seen[end] = (at_ns, place, 0.0)
            return 0.0
        passed_ns = at_ns - seen[0]
        if passed_ns < _SPEED_OVER_NS:
            return seen[2]
        speed_m_s = math.dist(seen[1], place) / passed_ns * NS_PER_S
        self._seen[end] = (at_ns, place, speed_m_s)
        return speed_m_s


CHANNEL_MHZ = 1.0  # what a receiver takes in at 250 kbit/s and 1 Mbit/s; 2 at 2 Mbit/s [DS 5.4]
BURST_S = 1.5e-3  # a full Wi-Fi frame at 8 Mbit/s
_KEPT_NS = NS_PER_S // 10  # bursts that ended earlier than this are forgotten


class Noise:
    """A transmitter that is no radio of the mesh, such as a jammer or Wi-Fi.

    It sends for ever, or in bursts with random pauses between them.
    """

    def __init__(
        self,
        position: Position,
        power_dbm: float,
        rng: random.Random,
        *,
        centre_mhz: float,
        width_mhz: float = CHANNEL_MHZ,
        duty: float = 1.0,
        burst_s: float = BURST_S,
        from_s: float = 0.0,
        until_s: float = math.inf,
    ) -> None:
        """`power_dbm`: radiated, in total, spread evenly over `width_mhz` about `centre_mhz`.

        `duty`: share of the time that it sends, from `from_s` to `until_s`. Raises
        ConfigurationError.
        """
        if not 0.0 < duty <= 1.0:
            raise ConfigurationError(f"invalid duty {duty}: must be above 0 and at most 1")
        if not width_mhz > 0.0 or not burst_s > 0.0:
            raise ConfigurationError("the width and the bursts of a noise must be above 0")
        self.position = position
        self._dbm_per_mhz = power_dbm - 10.0 * math.log10(max(width_mhz, CHANNEL_MHZ))
        self._low_mhz, self._high_mhz = centre_mhz - width_mhz / 2, centre_mhz + width_mhz / 2
        self._rng = rng
        self._burst_ns = round(burst_s * NS_PER_S)
        self._mean_pause_ns = self._burst_ns * (1.0 - duty) / duty
        self._from_ns = round(from_s * NS_PER_S)
        self._until_ns = math.inf if until_s == math.inf else round(until_s * NS_PER_S)
        self._bursts: deque[tuple[float, float]] = deque()  # start, end; those of late
        self._drawn_to_ns = float(self._from_ns)

    def stop(self, at_ns: int) -> None:
        """End the noise at this time."""
        self._until_ns = min(self._until_ns, at_ns)

    def power_dbm(self, carrier_mhz: int, width_mhz: float) -> float:
        """The power radiated within a receiver's channel, in dBm; -inf outside the noise's band."""
        low_mhz = max(self._low_mhz, carrier_mhz - width_mhz / 2)
        high_mhz = min(self._high_mhz, carrier_mhz + width_mhz / 2)
        if high_mhz <= low_mhz:
            return -math.inf
        return self._dbm_per_mhz + 10.0 * math.log10(high_mhz - low_mhz)

    def sends(self, start_ns: int, end_ns: int, throughout: bool = False) -> bool:
        """Whether it sends at some time within this span, or `throughout`. Ask in order of time."""
        if end_ns <= self._from_ns or start_ns >= self._until_ns:
            return False
        if not self._mean_pause_ns:
            inside = start_ns >= self._from_ns and end_ns <= self._until_ns
            return inside or not throughout
        self._draw(end_ns)
        if throughout:
            return any(begin <= start_ns and end_ns <= end for begin, end in self._bursts)
        return any(begin < end_ns and start_ns < end for begin, end in self._bursts)

    def _draw(self, to_ns: int) -> None:
        bursts = self._bursts
        while self._drawn_to_ns <= to_ns:
            begin_ns = self._drawn_to_ns + self._rng.expovariate(1.0) * self._mean_pause_ns
            self._drawn_to_ns = min(begin_ns + self._burst_ns, self._until_ns)
            if begin_ns >= self._until_ns:
                self._drawn_to_ns = math.inf
                break
            bursts.append((begin_ns, self._drawn_to_ns))
            if self._drawn_to_ns >= self._until_ns:
                self._drawn_to_ns = math.inf
        while bursts and bursts[0][1] < to_ns - _KEPT_NS:
            bursts.popleft()


class Space:
    """Distance, obstacles, fading and noise."""

    def __init__(self, links: LinkModel) -> None:
        self.links = links
        self.fading: Fading | None = None
        # What obstacles between two places cost in dB, in both directions; infinity: they block.
        self.obstacles: Callable[[Position, Position], float] | None = None
        self.noises: list[Noise] = []

    def lost_db(self, here: Position, there: Position) -> float:
        """The loss by obstacles between two places, in dB; set them before the first frame."""
        return 0.0 if self.obstacles is None else self.obstacles(here, there)

    def noise_dbm(
        self,
        place: Position,
        mhz: int,
        bits_per_s: int,
        span_ns: tuple[int, int],
        throughout: bool = False,
    ) -> float:
        """The power of the strongest noise within, or `throughout`, a span; -inf: there is none."""
        width_mhz = 2.0 if bits_per_s == 2_000_000 else CHANNEL_MHZ  # [DS 5.4]
        strongest_dbm = -math.inf
        for noise in self.noises:
            sent_dbm = noise.power_dbm(mhz, width_mhz)
            if sent_dbm > -math.inf and noise.sends(*span_ns, throughout):
                distance_m = math.dist(noise.position, place)
                power_dbm = self.links.received_dbm(distance_m, sent_dbm, mhz)
                strongest_dbm = max(strongest_dbm, power_dbm - self.lost_db(noise.position, place))
        return strongest_dbm
