"""Disarming: whether anything but an ordered landing has disarmed the drone.

A pilot who disarms wants it to stay down, and an autopilot that does has a reason, such as a crash.
This program must not arm it again until somebody else does, or chooses its mode anew.
"""

from __future__ import annotations

import math

from drone_mesh.drone.mavlink.telemetry import Telemetry

FELL_M = 1.5  # our choice: above the noise of a height at rest
FELL_WITHIN_S = 5.0  # our choice: a fall from 50 m takes 3.2 s


class Disarming:
    """Follows the heartbeats."""

    def __init__(self, telemetry: Telemetry) -> None:
        self.by_others = False
        self._telemetry = telemetry
        self._was_armed = False
        self._mode: int | None = None  # at the last heartbeat
        self._height_m = math.nan  # above sea level, when last seen armed
        self._landed_s = -math.inf  # when a landing seemed to have ended

    def on_heartbeat(self, now_s: float, lands: bool) -> None:
        """Compare with the heartbeat before.

        `lands`: this program is landing the drone, or has just landed it.
        """
        telemetry = self._telemetry
        assert telemetry.autopilot is not None  # otherwise the heartbeat is not the drone's
        place = telemetry.place(now_s)
        height_m = math.nan if place is None else place.altitude_m
        chosen_anew = telemetry.mode == telemetry.autopilot.own_mode != self._mode
        if telemetry.armed:
            self.by_others = False
            self._height_m = height_m
        elif self._was_armed:
            self.by_others = not lands
            self._landed_s = now_s if lands else -math.inf
        elif chosen_anew:
            self.by_others = False
            self._landed_s = -math.inf
        elif now_s - self._landed_s < FELL_WITHIN_S and height_m < self._height_m - FELL_M:
            self.by_others = True  # during the landing, in the air
        self._was_armed, self._mode = telemetry.armed, telemetry.mode
