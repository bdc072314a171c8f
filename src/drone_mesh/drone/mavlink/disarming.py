"""Disarming: whether anything but an ordered landing has disarmed the drone.

A pilot who disarms wants it to stay down, and an autopilot that does has a reason, such as a crash.
This program must not arm it again until somebody else does, or chooses its mode anew.
"""

from __future__ import annotations

import math

from drone_mesh.drone.mavlink.telemetry import Telemetry

FELL_M = 1.5  # above the noise of a height at rest
FELL_WITHIN_S = 5.0  # a fall from 50 m takes 3.2 s
ORDER_WITHIN_S = 5.0  # an order of this program has changed the mode by then
ARMED_WITHIN_S = 0.5  # a heartbeat just after the acknowledgement may be older


class Disarming:
    """Follows the heartbeats, and what this program orders."""

    def __init__(self, telemetry: Telemetry) -> None:
        self.by_others = False
        self.is_settling = False  # after a landing: it may have been disarmed in the air
        self._telemetry = telemetry
        self._was_armed = False
        self._armed_s = -math.inf  # when the autopilot accepted to arm
        self._mode: int | None = None  # at the last heartbeat
        self._ordered_s = -math.inf  # when this program last ordered its own mode
        self._height_m = math.nan  # above sea level, when last seen armed
        self._landed_s = -math.inf  # when a landing seemed to have ended

    def ordered_own_mode(self, now_s: float) -> None:
        """This program orders its own mode: that change is no choice of the pilot's."""
        self._ordered_s = now_s

    def accepted_to_arm(self, now_s: float) -> None:
        """The autopilot acknowledges that it armed by this program's order."""
        self._was_armed = True
        self._armed_s = now_s

    def on_heartbeat(self, now_s: float, lands: bool) -> None:
        """Compare with the heartbeat before.

        `lands`: this program is landing the drone, or has just landed it.
        """
        telemetry = self._telemetry
        assert telemetry.autopilot is not None  # otherwise the heartbeat is not the drone's
        place = telemetry.place(now_s)
        height_m = math.nan if place is None else place.altitude_m
        is_own = telemetry.mode == telemetry.autopilot.own_mode != self._mode
        self._mode = telemetry.mode
        if not telemetry.armed and self._was_armed and now_s - self._armed_s < ARMED_WITHIN_S:
            return
        if telemetry.armed:
            self.by_others = self.is_settling = False
            self._height_m = height_m
        elif self._was_armed:
            self.is_settling = lands and not math.isnan(self._height_m)
            self.by_others = not self.is_settling
            self._landed_s = now_s
        elif is_own and now_s - self._ordered_s >= ORDER_WITHIN_S:
            self.by_others = self.is_settling = False
        elif self.is_settling and not math.isnan(height_m):
            self.by_others = height_m < self._height_m - FELL_M
            self.is_settling = not self.by_others and now_s - self._landed_s < FELL_WITHIN_S
        self._was_armed = telemetry.armed
