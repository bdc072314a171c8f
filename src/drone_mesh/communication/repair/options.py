"""Adjustable options of the repair of a mesh."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from drone_mesh.settings import setting, settings_of

DEFAULT_REPAIR = "thesis"
RANGE_M = 9.0  # docs/ros.md, "Wireless signal simulator": a node nearer than this is in range
CLEARANCE_M = 1.0  # two drones of 0.5 m with a position error of 0.25 m each


class LostPlace(enum.Enum):
    """Where a repair ends if a silent drone may still be at the place that is to be taken."""

    BESIDE = "beside"
    ABOVE = "above"
    BELOW = "below"  # above, if the ground is in the way
    EXACT = "exact"  # at that very place, as in the document


class LostMesh(enum.Enum):
    """What a drone does that has no gateway for long."""

    REPAIR = "repair"  # it repairs, as long as its battery reaches home
    HOLD = "hold"  # it stays where it is, also for a repair
    RETURN = "return"  # it repairs, then flies home and lands
    LAND = "land"  # it repairs, then lands where it is


@dataclass(frozen=True)
class RepairOptions:
    """Adjustable numbers of the repair of one node."""

    clearance_m: float = setting(
        CLEARANCE_M,
        "minimum distance in metres between drones at rest after a repair",
        "metres",
        above=0,
        most=100.0,
    )
    range_m: float = setting(
        RANGE_M,
        "range of the radio in metres, as far as a repair knows",
        "metres",
        above=0,
        most=10_000.0,
    )
    lost_place: LostPlace = setting(
        LostPlace.BESIDE,
        "where a repair ends if a silent drone may still be at the place: beside, above, below or "
        "exact, which is that very place",
    )
    lost_mesh: LostMesh = setting(
        LostMesh.REPAIR,
        "what a drone without a gateway does: repair, hold its place, or after lost_mesh_after "
        "return home or land where it is: repair, hold, return or land",
    )
    lost_mesh_after_s: float = setting(
        120.0,
        "seconds without a gateway before a drone returns home or lands (lost_mesh)",
        "seconds",
        least=0.1,
        most=36_000.0,
    )

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a number outside its range."""
        for declared in settings_of(self):
            declared.check(declared.default)  # the value of this instance
