"""What a file contains: points and lines, and the drones that they are for or come from."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Iterable, Mapping, NamedTuple, Sequence

from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, GoalRefused

STEP_M = 0.5  # a track has a place whenever the drone has moved so far
MOST_PLACES = 20_000  # of all tracks
_ID = re.compile(r"[0-9]{1,3}")
_NAMED = re.compile(r"(?:drone|node|router|gateway)\s*([0-9]{1,3})", re.IGNORECASE)


class Point(NamedTuple):
    """A place, and the drone that it is for; None: any."""

    drone: int | None
    place: Location


class Path(NamedTuple):
    """The way of a drone; None: any. `times_s`: when it was at each place, if that is known."""

    drone: int | None
    places: Sequence[Location]
    times_s: Sequence[float] = ()


@dataclass
class Placemarks:
    """The content of a file, in metres of the common frame."""

    points: list[Point] = field(default_factory=list)
    paths: list[Path] = field(default_factory=list)

    def add_point(self, drone: int | None, place: Location) -> None:
        """Raises ConfigurationError for a drone that has a place already."""
        if drone is not None and any(point.drone == drone for point in self.points):
            raise ConfigurationError(f"drone {drone} has two places")
        self.points.append(Point(drone, place))

    def add_path(self, drone: int | None, places: Sequence[Location]) -> None:
        """Raises ConfigurationError for a line that leads nowhere."""
        if len(places) < 2:
            raise ConfigurationError(f"a line with {len(places)} places: it needs two")
        self.paths.append(Path(drone, places))

    @property
    def is_mission(self) -> bool:
        """Whether lines go through its points: then these are the waypoints of one drone each.

        Ground stations save a mission so. Points that name a drone are places.
        """
        corners = {_metre(place) for path in self.paths for place in path.places}
        through = sum(
            point.drone is None and not corners.isdisjoint(_metres_around(point.place))
            for point in self.points
        )
        return 2 * through > len(self.points)

    def goals(self, at: Mapping[int, Location]) -> dict[int, Location]:
        """The place of each drone; one without a number is for the nearest of those `at` places.

        Drones without a known place and without a point are not sent. Raises ConfigurationError if
        there are more places than drones, and for what is no layout.
        """
        if not self.points:
            raise ConfigurationError("has lines and no points: a layout is made of points")
        if self.is_mission:
            raise ConfigurationError(
                f"a mission of one drone, as a line goes through its {len(self.points)} points, "
                "and no layout: load it on the console's page, which offers it to the drone you "
                "select there"
            )
        goals = {point.drone: point.place for point in self.points if point.drone is not None}
        free = [point.place for point in self.points if point.drone is None]
        others = len(at.keys() - goals.keys())
        if len(free) > others:
            raise ConfigurationError(f"{len(free)} points for any drone, and {others} drones")
        ways = sorted(
            (place.distance_m(at[drone]), drone, number)
            for drone in at.keys() - goals.keys()
            for number, place in enumerate(free)
        )
        taken: set[int] = set()
        for _way_m, drone, number in ways:
            if drone not in goals and number not in taken:
                goals[drone] = free[number]
                taken.add(number)
        return goals


def drone_named(name: str | None) -> int | None:
    """The drone in a name such as "drone 3" or "Router 3"; None: it names none.

    A bare number names none: programs number their points. Raises ConfigurationError for an id
    that no drone can have.
    """
    match = _NAMED.fullmatch((name or "").strip())
    return None if match is None else drone_with(match[1])


def drone_with(number: str) -> int | None:
    """The drone with this id; None: it is none. Raises as `drone_named`."""
    if _ID.fullmatch(number) is None:
        return None
    if int(number) >= MAX_DRONES:
        raise ConfigurationError(f"drone {number}: the largest id is {MAX_DRONES - 1}")
    return int(number)


def _metre(place: Location) -> tuple[int, int]:
    return round(place.longitude), round(place.latitude)


def _metres_around(place: Location) -> Iterable[tuple[int, int]]:
    """The cells of 1 m that may hold this place, which programs round differently."""
    x, y = _metre(place)
    return ((x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1))


def place_on(
    origin: Origin, latitude_deg: float, longitude_deg: float, height_m: float
) -> Location:
    """A place of the common frame, `height_m` above the origin.

    Raises ConfigurationError if it is no place on the earth, or not one for a drone.
    """
    if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180 and math.isfinite(height_m)):
        raise ConfigurationError(
            f"{longitude_deg:.9g}, {latitude_deg:.9g} is not a longitude and a latitude in degrees"
        )
    altitude_m = origin.altitude_m + height_m
    place = origin.to_frame(EarthPlace(latitude_deg, longitude_deg, altitude_m))
    metres = (round(value, 2) + 0.0 for value in (place.latitude, place.longitude, height_m))
    place = Location(*metres)
    try:
        check_goal(*place)
    except GoalRefused as error:
        where = f"{latitude_deg:.6f}, {longitude_deg:.6f}"
        raise ConfigurationError(f"{where}, in metres from the origin: {error}") from error
    return place


def on_earth(origin: Origin, place: Location) -> tuple[float, float, float]:
    """Longitude and latitude to a centimetre, and metres above sea level."""
    earth = origin.to_earth(place)
    return (
        round(earth.longitude_deg, 7),
        round(earth.latitude_deg, 7),
        round(earth.altitude_m, 3),
    )


def tracks_of(positions: Iterable[tuple[float, int, Sequence[float]]]) -> Placemarks:
    """Where each node has been; a node that never moved has no track.

    `positions`: seconds, the node, and x, y, z in metres, by rising time.
    """
    times: dict[int, list[float]] = {}
    places: dict[int, list[Location]] = {}
    for at_s, node, position in positions:
        track = places.setdefault(node, [])
        place = Location.from_vector(position)
        if not track or place.distance_m(track[-1]) >= STEP_M:
            track.append(place)
            times.setdefault(node, []).append(round(at_s, 2))
    total = sum(len(track) for track in places.values() if len(track) > 1)
    step = max(1, math.ceil(total / MOST_PLACES))
    return Placemarks(
        paths=[
            Path(node, [*track[:-1:step], track[-1]], [*times[node][:-1:step], times[node][-1]])
            for node, track in sorted(places.items())
            if len(track) > 1
        ]
    )
