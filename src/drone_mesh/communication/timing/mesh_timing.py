"""The adjustable times and counts of the mesh protocol."""

from __future__ import annotations

from dataclasses import dataclass, replace

from drone_mesh.errors import ConfigurationError

HEARTBEAT_ANSWER_S = 0.5  # at most one heartbeat to the gateway within this time
CIRCULATION_S = 0.5  # the same packet from another neighbour within this time circulates
FLIGHT_POSITION_PERIOD_S = 1.0  # how often a flying node requests its position
MIN_REPORT_PERIOD_S = 30.0  # docs/protocol.md, "Node reports"
LANDED_WITHIN_M = 0.1  # docs/repair.md, "Flight"


@dataclass(frozen=True)
class MeshTiming:
    """Adjustable numbers of one node; the defaults are those of docs/protocol.md."""

    check_period_s: float = 10.0  # how often a node checks its routes and its connection
    connection_lost_after_s: float = 0.0  # time without a gateway until the emergency; 0: as the
    # routing technique says
    send_attempts: int = 3  # failed transmissions of a packet, in total
    report_period_s: float = 0.0  # how often a node reports to its gateway; 0: never

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
