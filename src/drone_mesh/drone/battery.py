"""The battery of a drone, and the crews that swap it on a pad.

The power in the air is that of Liu, Sengupta and Kurzhanskiy (ICUAS 2017, "A power consumption
model for multi-rotor small unmanned aircraft systems"), validated on an IRIS+ quadrotor, with the
coefficients c1, c2, c4 and c5 that route planners use for it (1.5 kg: 176 W in hover). Climbs are
not counted: a Solo takes a fifth more to climb and a tenth less to descend (ArduPilot's forum,
topic 32200). Measured on a smaller drone: 7.7 W for the 28.6 g that a Crazyflie 2.0 lifts
(Bitcraze's wiki, investigations, thrust).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Sequence

GRAVITY_M_S2 = 9.81
LAND_AT_PERCENT = 20.0  # it comes down while it still can
MARGIN_PERCENT = 2.0  # above that, or what it must keep, when it is home
READY_PERCENT = 95.0  # a crew leaves a fuller battery in the drone
FLAT = 0.0
LEAST_USE_PERCENT = 2.0  # less says nothing: autopilots report whole percents

_LIFT = 2.8037 + 0.3177  # W/N^1.5: c1 and c2, induced and profile power
_DRAG = 0.0296  # N/(m/s)^2: c4, parasitic drag
_WIND_LIFT = 0.0279  # N/(m/s)^2: c5, lift of the rotors in forward flight


@dataclass(frozen=True)
class PowerModel:
    """What a drone takes from its battery."""

    mass_kg: float = 1.0
    hover_s: float = 1200.0  # hovering time with a full battery, which gives its capacity
    electronics_w: float = 3.2  # chosen here: a Raspberry Pi 4 that idles, 2.7 W, and an autopilot
    radio_w: float = 0.045  # nRF24L01+ PS v1.0: 13.5 mA while it listens, at 3.3 V

    def watts(self, speed_m_s: float | None) -> float:
        """The power at this speed in the air (0: in hover); None: on the ground."""
        standing = self.electronics_w + self.radio_w
        if speed_m_s is None:
            return standing
        lift = self.mass_kg * GRAVITY_M_S2 - _WIND_LIFT * speed_m_s**2
        thrust = math.hypot(lift, _DRAG * speed_m_s**2)
        return standing + _LIFT * thrust * math.sqrt(thrust) + _DRAG * speed_m_s**3

    @property
    def capacity_j(self) -> float:
        """Of a full battery."""
        return self.hover_s * self.watts(0.0)


class Endurance(NamedTuple):
    """How long a drone can stay in the air."""

    hover_left_s: float = math.nan  # until it comes down by itself; NaN: for ever, or unknown
    home: Sequence[float] = ()  # (3,) m, its pad, where crews swap its battery; empty: none
    pad: str = ""  # what they do for it, in words; empty: nothing


class Battery:
    """The charge of one drone."""

    def __init__(self, model: PowerModel) -> None:
        """It is full."""
        self._model = model
        self._full_j = self._left_j = model.capacity_j
        self.used_j = 0.0  # from all batteries that the drone has had

    @property
    def percent(self) -> float:
        """Its charge, 0..100."""
        return 100.0 * self._left_j / self._full_j

    @property
    def hover_left_s(self) -> float:
        """How long it can hover until it comes down."""
        return max(0.0, self.percent - LAND_AT_PERCENT) / 100.0 * self._model.hover_s

    def use(self, seconds: float, speed_m_s: float | None) -> None:
        """Let so much time pass at this speed in the air; None: on the ground."""
        wanted_j = seconds * self._model.watts(speed_m_s)
        used_j = min(wanted_j, self._left_j)
        self.used_j += used_j
        self._left_j -= used_j

    def swap(self) -> None:
        """Put in a full battery."""
        self._left_j = self._full_j


class BatteryUse:
    """How fast a drone empties its battery, by the figures that it shows."""

    def __init__(self) -> None:
        self._since = (-math.inf, 0.0)  # percent, and when
        self.per_s = self._in_hover = 100.0 / PowerModel.hover_s  # percent; at least this

    def note(self, percent: float, now_s: float) -> None:
        """It shows this charge; what counts is how long the last LEAST_USE_PERCENT took."""
        before, since_s = self._since
        if percent > before:  # it has another battery
            self._since = percent, now_s
        elif before - percent >= LEAST_USE_PERCENT and now_s > since_s:
            self._since = percent, now_s
            self.per_s = max(self._in_hover, (before - percent) / (now_s - since_s))


class Crews:
    """The crew of each pad, which gives drones that stand on it full batteries, in turn."""

    def __init__(self, swap_s: float, at_once: int = 1) -> None:
        """A swap takes `swap_s`; each crew works on so many drones `at_once`."""
        self._swap_s, self._at_once = swap_s, at_once
        self._ends_s: dict[int, dict[int, float]] = {}  # by pad, by drone in turn; inf: it waits
        self.swaps = 0

    def serve(self, drone: int, pad: int, now_s: float) -> bool:
        """This drone stands on its pad and wants a battery; returns whether it has one now."""
        ends_s = self._ends_s.setdefault(pad, {})
        ends_s.setdefault(drone, math.inf)
        waiting = [one for one, end_s in ends_s.items() if end_s == math.inf]
        if waiting[:1] == [drone] and len(ends_s) - len(waiting) < self._at_once:
            ends_s[drone] = now_s + self._swap_s
        if now_s < ends_s[drone]:
            return False
        del ends_s[drone]
        self.swaps += 1
        return True

    def in_words(self, drone: int, pad: int, now_s: float) -> str:
        """What they do for this drone, or that it waits; empty: neither. Any thread."""
        end_s = self._ends_s.get(pad, {}).get(drone)
        crew = "the crew" if self._at_once == 1 else f"one of {self._at_once} crews"
        if end_s is None or math.isinf(end_s):
            return "" if end_s is None else f"waits for {crew}"
        return f"{crew} swaps its battery: {max(0.0, end_s - now_s):.0f} s left"

    def leave(self, drone: int, pad: int) -> None:
        """It does not want one any more."""
        self._ends_s.get(pad, {}).pop(drone, None)
