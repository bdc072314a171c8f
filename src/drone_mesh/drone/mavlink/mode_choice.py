"""ModeChoice: who chose the mode that the autopilot is in."""

from __future__ import annotations

import enum
import math

from drone_mesh.drone.mavlink.telemetry import Telemetry


class Chooser(enum.Enum):
    """Whose choice the mode is."""

    ENGINE = "this program, or somebody who chose the mode in which it flies"
    OTHERS = "the pilot, a ground station or the autopilot"
    NOBODY = "found at the first contact on a disarmed drone, which nobody has armed since"


class ModeChoice:
    """Follows the heartbeats. What this program has not commanded, somebody else has chosen.

    A failsafe that acts in a mode of this program's makes that mode the autopilot's choice.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._mode: int | None = None  # at the last heartbeat
        self._armed = False
        self._commanded: int | None = None
        self.by = Chooser.NOBODY
        self.since_s = -math.inf  # when somebody else chose it

    def was_made_after(self, time_s: float) -> bool:
        """Whether somebody else chose the mode later than this."""
        return self.by is Chooser.OTHERS and self.since_s > time_s

    def command(self, mode: int) -> None:
        """This program is about to order this mode."""
        self._commanded = mode

    def withdraw(self) -> None:
        """Stop expecting the mode that this program ordered, unless it is reported already."""
        if self._commanded != self._mode:
            self._commanded = None

    def accepted(self, mode: int) -> None:
        """The autopilot acknowledges that it is in this mode, ordered by this program.

        A later heartbeat with another mode therefore tells of a choice, even of the mode before.
        """
        self._mode = mode
        self._commanded = None
        self.by = Chooser.ENGINE

    def on_heartbeat(self, now_s: float) -> None:
        """Compare with the heartbeat before."""
        telemetry = self._telemetry
        assert telemetry.autopilot is not None  # otherwise the heartbeat is not the drone's
        before, was_armed = self._mode, self._armed
        mode, armed = telemetry.mode, telemetry.armed
        self._mode, self._armed = mode, armed
        if mode == telemetry.autopilot.own_mode:
            self.by = Chooser.ENGINE
            if before != mode:
                self._commanded = None
        elif before is None:
            self._decide(Chooser.OTHERS if armed else Chooser.NOBODY, now_s)
        elif mode != before:
            self._decide(Chooser.ENGINE if mode == self._commanded else Chooser.OTHERS, now_s)
        elif self.by is not Chooser.OTHERS and (telemetry.failsafe or armed and not was_armed):
            self._decide(Chooser.OTHERS, now_s)

    def _decide(self, by: Chooser, now_s: float) -> None:
        self.by = by
        if by is Chooser.OTHERS:
            self.since_s = now_s
            self._commanded = None
