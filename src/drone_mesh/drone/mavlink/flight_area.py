"""FlightArea: the drone's position in the common frame, and the area that no target leaves."""

from __future__ import annotations

import math

from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.drone.mavlink.telemetry import Telemetry

HOME_OFF_M = 10.0  # more than a GPS is wrong by, on a field without hills


class FlightArea:
    """Reads the telemetry; changes nothing."""

    def __init__(self, telemetry: Telemetry, origin: Origin, limits: FlightLimits) -> None:
        self._telemetry = telemetry
        self._origin = origin
        self._limits = limits

    def here(self, now_s: float) -> Location | None:
        """The drone's position; None if the telemetry does not have it."""
        place = self._telemetry.place(now_s)
        return None if place is None else self._origin.to_frame(place)

    def home(self) -> Location | None:
        """The autopilot's home; None: not reported yet."""
        home = self._telemetry.home
        return None if home is None else self._origin.to_frame(home)

    def is_in_frame(self, place: EarthPlace) -> bool:
        """Whether a position is near enough to the origin for goals."""
        location = self._origin.to_frame(place)
        reach_m = max(abs(location.latitude), abs(location.longitude))
        return reach_m <= MAX_COORDINATE_M and abs(location.height) <= MAX_HEIGHT_M

    def doubts(self) -> str:
        """Why --origin may have a wrong altitude; empty without a sign of that."""
        home = self.home()
        if home is None or abs(home.height) <= HOME_OFF_M:
            return ""
        where = "above" if home.height > 0.0 else "below"
        return (
            f"its home is {abs(home.height):.0f} m {where} --origin: unless the ground is, correct "
            "the altitude of --origin, in metres above sea level"
        )

    def within(self, place: Location) -> Location:
        """The nearest position within the limits; no target is outside, wherever the drone is."""
        home = self.home()
        if home is None:
            return place
        east, north = place.longitude - home.longitude, place.latitude - home.latitude
        distance_m = math.hypot(east, north)
        share = min(1.0, self._limits.max_distance_m / distance_m) if distance_m else 1.0
        return Location(
            latitude=home.latitude + north * share,
            longitude=home.longitude + east * share,
            height=min(place.height, self._limits.ceiling_m(home)),
        )

    def to_earth(self, place: Location) -> EarthPlace:
        """A position, moved into the limits, in degrees."""
        return self._origin.to_earth(self.within(place))
