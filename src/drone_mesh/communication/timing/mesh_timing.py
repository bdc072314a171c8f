"""The adjustable times and counts of the mesh protocol."""

from __future__ import annotations

from dataclasses import dataclass, replace

from drone_mesh.errors import ConfigurationError
from drone_mesh.settings import setting

HEARTBEAT_ANSWER_S = 0.5  # at most one heartbeat to the gateway within this time
CIRCULATION_S = 0.5  # the same packet from another neighbour within this time circulates
FLIGHT_POSITION_PERIOD_S = 1.0  # how often a flying node requests its position
MIN_REPORT_PERIOD_S = 30.0  # docs/protocol.md, "Node reports"
LANDED_WITHIN_M = 0.1  # docs/repair.md, "Flight"


@dataclass(frozen=True)
class MeshTiming:
    """Adjustable numbers of one node; the defaults are those of docs/protocol.md."""

    check_period_s: float = setting(
        10.0,
        "seconds between two checks of routes and connection",
        "seconds",
        least=0.1,
        most=3600.0,
    )
    connection_lost_after_s: float = setting(
        0.0,
        "seconds without a gateway before a node starts a repair",
        "seconds",
        least=0.1,
        most=3600.0,
        zero="those of the routing technique: 30, or 10 with beacon",
    )
    send_attempts: int = setting(
        3, "failed transmissions of a packet, in total", "a whole number", least=1, most=20
    )
    report_period_s: float = setting(
        0.0,
        "seconds between two reports of a router to its gateway, for GET /mesh and the web console",
        "seconds",
        least=MIN_REPORT_PERIOD_S,
        most=3600.0,
        zero="no reports",
    )

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a number outside its range."""
        if not self.check_period_s > 0:
            raise ConfigurationError(
                f"invalid check_period {self.check_period_s}: must be above 0 seconds"
            )
        if not self.connection_lost_after_s >= 0:
            raise ConfigurationError(
                f"invalid connection_lost_after {self.connection_lost_after_s}: "
                "must be above 0 seconds, or 0 for that of the technique"
            )
        if self.send_attempts < 1:
            raise ConfigurationError(
                f"invalid send_attempts {self.send_attempts}: must be at least 1"
            )
        if not (self.report_period_s == 0 or self.report_period_s >= MIN_REPORT_PERIOD_S):
            raise ConfigurationError(
                f"invalid report_period {self.report_period_s}: must be 0 (no reports) or at "
                f"least {MIN_REPORT_PERIOD_S:g} seconds"
            )

    def lost_after(self, seconds: float) -> MeshTiming:
        """The same; without a gateway for `seconds` is an emergency, unless these set it."""
        return (
            self if self.connection_lost_after_s else replace(self, connection_lost_after_s=seconds)
        )
