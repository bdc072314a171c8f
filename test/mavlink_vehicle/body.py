"""The body of the simulated drone: position, movement, battery; and the faults of a vehicle."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.drone.location import Location

LANDING_SPEED_M_S = 1.0
ARRIVED_M = 0.05
DRAIN_PERCENT_S = 0.05  # discharge per second in the air


@dataclass
class VehicleFaults:
    """Faults, which may be set at any time; none by default."""

    silent: bool = False  # the link is broken in both directions
    fix_type: int = 3  # GPS_FIX_TYPE
    estimate_good: bool = True
    positions_stop: bool = False
    fence_breached: bool = False
    fence_on: bool = False  # by a switch, whatever its parameter says
    refuses_to_arm: bool = False
    spool_up_s: float = 0.0  # from the acknowledgement of a take-off to the first movement
    battery_known: bool = True
    stick_us: int = 1500  # of the roll stick


class Body:
    """Moves in straight lines at one speed, as the in-process drone does, relative to home."""

    def __init__(self) -> None:
        self.place = Location(0.0, 0.0, 0.0)
        self.armed = False
        self.battery_percent = 100.0
        self.speed_m_s = 5.0  # unless targets are slower
        self.velocity = (0.0, 0.0, 0.0)  # north, east, up; m/s

    @property
    def on_ground(self) -> bool:
        """Whether it is on the ground, which is level here."""
        return self.place.height <= 0.0

    def move(self, target: Location | None, passed_s: float, speed_m_s: float) -> bool:
        """Move towards `target` (None: stay); returns whether it has arrived."""
        before = self.place
        if self.armed and target is not None:
            distance_m = before.distance_m(target)
            step_m = speed_m_s * passed_s
            self.place = target if step_m >= distance_m else before.towards(target, step_m)
        if passed_s > 0.0:
            self.velocity = (
                (self.place.latitude - before.latitude) / passed_s,
                (self.place.longitude - before.longitude) / passed_s,
                (self.place.height - before.height) / passed_s,
            )
        if self.armed and not self.on_ground:
            drained = DRAIN_PERCENT_S * passed_s
            self.battery_percent = max(0.0, self.battery_percent - drained)
        return target is not None and self.place.distance_m(target) <= ARRIVED_M
