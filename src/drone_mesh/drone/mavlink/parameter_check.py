"""ParameterCheck: reads the parameters of an autopilot that make a flight safe."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from drone_mesh.drone.mavlink.autopilots import Requirement
from drone_mesh.drone.mavlink.commander import Commander
from drone_mesh.drone.mavlink.telemetry import Message, Telemetry

PERIOD_S = 0.5
TRIES = 6  # for all names of a requirement together

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Finding:
    """A parameter that was read, and whether its value is safe."""

    requirement: Requirement
    name: str  # in this release of the autopilot, or the oldest name if it could not be read
    value: float | None  # None: it could not be read

    @property
    def is_safe(self) -> bool:
        """Whether the requirement holds."""
        return self.value is not None and self.requirement.holds(self.value)

    @property
    def complaint(self) -> str:
        """The parameter in words, if its value is not safe; otherwise empty."""
        if self.is_safe:
            return ""
        found = "could not be read" if self.value is None else f"is {self.value:g}"
        return f"{self.name} {found} (wanted: {self.requirement.wanted})"


class ParameterCheck:
    """Asks for one parameter after the other; logs those with unsafe values."""

    def __init__(self, commander: Commander, telemetry: Telemetry) -> None:
        self._commander = commander
        self._telemetry = telemetry
        self._open: list[Requirement] | None = None  # None: not begun
        self._due_s = -math.inf
        self._asked = 0
        self.findings: tuple[Finding, ...] = ()

    @property
    def is_done(self) -> bool:
        """Whether every parameter was read or given up."""
        return self._open is not None and not self._open

    @property
    def complaints(self) -> tuple[str, ...]:
        """The parameters, read or given up until now, whose values are not safe."""
        return tuple(finding.complaint for finding in self.findings if not finding.is_safe)

    def tick(self, now_s: float) -> None:
        autopilot = self._telemetry.autopilot
        if autopilot is None:
            return
        if self._open is None:
            self._open = list(autopilot.requirements)
        if not self._open or now_s < self._due_s:
            return
        names = self._open[0].names
        if self._asked == TRIES:
            self._close(names[-1], None)
            return
        self._commander.read_parameter(names[self._asked % len(names)])
        self._asked += 1
        self._due_s = now_s + PERIOD_S

    def on_value(self, message: Message) -> None:
        autopilot = self._telemetry.autopilot
        if not self._open or autopilot is None or message.param_id not in self._open[0].names:
            return
        value = autopilot.parameter_value(message.param_value, message.param_type)
        self._close(str(message.param_id), value)

    def _close(self, name: str, value: float | None) -> None:
        assert self._open
        finding = Finding(self._open.pop(0), name, value)
        self._asked, self._due_s = 0, -math.inf
        self.findings += (finding,)
        if not finding.is_safe:
            _log.warning("autopilot: %s; see docs/flying.md", finding.complaint)
