"""The activity of the drone under this program, and a snapshot of its status."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from drone_mesh.drone.location import Location


class Phase(enum.Enum):
    """The activity of the drone under this program."""

    IDLE = "idle"
    CHANGING_MODE = "changing mode"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    FLYING = "flying"
    HOLDING = "holding"
    LANDING = "landing"


UNDER_WAY = frozenset(Phase) - {Phase.IDLE, Phase.HOLDING}


@dataclass(frozen=True)
class PilotStatus:
    """A snapshot of the drone's status. Immutable, so any thread may keep it."""

    phase: Phase = Phase.IDLE
    location: Location | None = None
    location_trouble: str = "no heartbeat from an ArduPilot or PX4 autopilot yet"
    home: Location | None = None
    why_not_fly: str = "no heartbeat from an ArduPilot or PX4 autopilot yet"
    why_not_repair: str = "no heartbeat from an ArduPilot or PX4 autopilot yet"
    ended: str = ""  # why the last flight ended before its goal; empty: it did not
    autopilot: str = ""
    mode: str = ""
    armed: bool = False
    on_ground: bool | None = None
    battery_percent: float | None = None
    complaints: tuple[str, ...] = ()  # parameters with unsafe values
    goal: Location | None = None

    @property
    def is_flying(self) -> bool:
        return self.phase in UNDER_WAY
