"""Fading: links whose power rises and falls because many copies of a wave add up.

Block fading: the gain of a link is constant for one coherence time, and then it is another one. The
coherence time is 0.423 / f_D (Rappaport, Wireless Communications, 1996, eq. 5.40.c). The Doppler
spread f_D = (v1 + v2) / wavelength for two ends that both move (Akki and Haber, A statistical model
of mobile-to-mobile land communication channel, IEEE TVT 1986). Both directions have the same gain.
"""

from __future__ import annotations

import math
import random
from typing import Hashable, Tuple

from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.airtime import NS_PER_S

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
