"""Missions that were drawn in other programs: plans, waypoint files, lines of GeoJSON and KML.

A mission item is flown, or named: nothing is left out in silence.
"""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple, Sequence

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.geodesy import Origin
from drone_mesh.earth_files import is_earth_file, read_placemarks
from drone_mesh.earth_files.placemarks import place_on
from drone_mesh.earth_files.plan import (
    MAX_PLAN_CHARACTERS,
    Plan,
    PlanItem,
    read_plan,
    read_waypoints,
)
from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import read_text

MOST_WAYPOINTS = 1000
MOST_NOTES = 20  # they are logged in one line
_READERS = {".plan": read_plan, ".waypoints": read_waypoints}

# MAV_CMD and MAV_FRAME of MAVLink's common.xml
_TAKE_OFFS, _LANDINGS, _RETURN, _SPEED = (22, 84), (21, 85), 20, 178
_WAYPOINT, _SPLINE = 16, 82
_LOITERS = (17, 18, 19, 31)  # for ever, turns, a time, to a height
_STOPS = (_WAYPOINT, _SPLINE, *_LOITERS)
_NAMES = {
    20: "return to launch", 21: "landing", 93: "delay", 112: "delay", 115: "yaw", 177: "jump",
    183: "servo", 195: "look at", 201: "look at", 203: "photo", 205: "gimbal", 206: "photos",
    211: "gripper", 530: "camera", 531: "zoom", 1000: "gimbal", 2000: "photos", 2500: "video",
}  # fmt: skip
_ABOVE_SEA, _ABOVE_HOME, _ABOVE_TERRAIN = (0, 5), (3, 6), (10, 11)


class DrawnMission(NamedTuple):
    """What a file says, in metres of the common frame, and what is told of it."""

    waypoints: Sequence[Vector]
    speed_m_s: float | None  # None: it says nothing
    notes: Sequence[str]  # how its heights are taken, and what is not flown

    def in_words(self) -> str:
        """What is told of it, in one line."""
        count = len(self.waypoints)
        return "; ".join((f"{count} waypoint{'s' * (count > 1)}", *self.notes))


def is_mission_file(name: str) -> bool:
    """Whether a file of this name is for `read_mission` and nothing else."""
    return name.lower().endswith(tuple(_READERS))


def read_mission_file(path: Path, origin: Origin | None) -> DrawnMission:
    """The mission in this file. Raises as `read_mission`."""
    return read_mission(read_text(path, most_bytes=MAX_PLAN_CHARACTERS), str(path), origin)


def read_mission(text: str, name: str, origin: Origin | None) -> DrawnMission:
    """The mission in this text of a file: a .plan, a .waypoints, or one line of GeoJSON or KML.

    Raises ConfigurationError, one line that begins with `name`.
    """
    try:
        drawn = _read(text, name, origin)
        _check_count(len(drawn.waypoints))
    except ConfigurationError as error:
        if str(error).startswith(name):
            raise
        raise ConfigurationError(f"{name}: {error}") from error
    return drawn


def _read(text: str, name: str, origin: Origin | None) -> DrawnMission:
    if not is_earth_file(name):
        raise ConfigurationError("expected a .plan, .waypoints, .kml or .geojson file")
    if not is_mission_file(name):
        lines = read_placemarks(text, name, origin).paths
        if len(lines) != 1:
            raise ConfigurationError(f"has {len(lines)} lines: keep the one to fly")
        return DrawnMission([place.to_vector() for place in lines[0].places], None, [])
    if origin is None:
        raise ConfigurationError("its places are in degrees: that needs an origin")
    if len(text) > MAX_PLAN_CHARACTERS:
        raise ConfigurationError(f"longer than {MAX_PLAN_CHARACTERS} characters")
    plan = _READERS[name[name.rfind(".") :].lower()](text)
    _check_count(sum(item.command in _STOPS for item in plan.items) or 1)  # before it takes time
    return _Way(origin).along(plan)


def _check_count(waypoints: int) -> None:
    if not 1 <= waypoints <= MOST_WAYPOINTS:
        raise ConfigurationError(f"{waypoints} waypoints: a mission has 1 to {MOST_WAYPOINTS}")


class _Way:
    """Makes waypoints of mission items, one after the other."""

    def __init__(self, origin: Origin) -> None:
        self._origin = origin
        self._places: list[Vector] = []
        self._height_m = math.nan  # that holds for an item without one
        self._speed_m_s: float | None = None
        self._told: dict[str, list[str]] = defaultdict(list)  # of which items; of all: none

    def along(self, plan: Plan) -> DrawnMission:
        """The mission in a file. Raises ConfigurationError."""
        self._speed_m_s = plan.speed_m_s
        for item in plan.items:
            try:
                self._take(item, plan)
            except ConfigurationError as error:
                raise ConfigurationError(f"{item.where}: {error}") from error
        told = [f"{what}{_names(items)}" for what, items in self._told.items()]
        unread = [f"not flown: {what}" for what in plan.unread]
        notes = [*told, *unread]
        if len(notes) > MOST_NOTES:
            notes[MOST_NOTES:] = [f"and {len(notes) - MOST_NOTES} more such notes"]
        return DrawnMission(self._places, self._speed_m_s, notes)

    def _take(self, item: PlanItem, plan: Plan) -> None:
        command, values = item.command, item.values
        if command in _STOPS:
            self._places.append(self._place(item))
            if command == _SPLINE:
                self._told["flown in straight lines"].append(item.where)
            elif command in _LOITERS or values[0] > 0:
                self._told["passed without a stop"].append(item.where)
        elif command in _TAKE_OFFS:  # where it stands: the pilot climbs to the first waypoint
            self._height_m = self._height(item)
            if self._places:
                self._places.append((*self._places[-1][:2], self._height_m))
        elif command in _LANDINGS and (self._places or _has_place(item)):
            self._land(self._place(item))
        elif command == _RETURN and plan.home is not None and self._places:
            latitude, longitude = plan.home
            home = place_on(self._origin, latitude, longitude, self._height_m)
            self._land(home.to_vector())
            at = f"x {home.longitude:g}, y {home.latitude:g} m"
            self._told[f"returns to its planned home, {at}"].append(item.where)
        elif command == _SPEED and not self._places:
            self._speed_m_s = values[1] if values[1] > 0 else self._speed_m_s
        elif command == _SPEED:
            self._told["one speed all the way, not changed at"].append(item.where)
        else:
            what = _NAMES.get(command, "command")
            self._told[f"not done: {what} ({command})"].append(item.where)

    def _land(self, above: Vector) -> None:
        self._places += [above, (*above[:2], 0.0)]

    def _place(self, item: PlanItem) -> Vector:
        """Of an item without a place: that of the waypoint before, as ArduPilot takes it."""
        if item.command not in _LANDINGS or math.isnan(self._height_m):
            self._height_m = self._height(item)
        if _has_place(item):
            latitude, longitude = item.values[4:6]
            return place_on(self._origin, latitude, longitude, self._height_m).to_vector()
        if not self._places:
            raise ConfigurationError("has no place, and no waypoint is before it")
        return (*self._places[-1][:2], self._height_m)

    def _height(self, item: PlanItem) -> float:
        """Above the origin. An item at 0 keeps the height before, as ArduCopter takes it."""
        height_m = item.values[6]
        if item.frame in _ABOVE_TERRAIN:
            raise ConfigurationError(
                "its height is above the terrain, which is not known: save it relative to home"
            )
        if item.frame not in _ABOVE_SEA and item.frame not in _ABOVE_HOME:
            raise ConfigurationError(f"its frame is {item.frame}: expected 0 or 3")
        if math.isnan(height_m) or (height_m == 0 and item.frame in _ABOVE_HOME):
            if math.isnan(self._height_m):
                raise ConfigurationError("has no height, and no item before it has one")
            return self._height_m
        if item.frame in _ABOVE_HOME:
            self._told["heights above home are taken as above the origin"] = []
            return height_m
        sea_m = self._origin.altitude_m
        self._told[f"heights above sea level are taken less the {sea_m:g} m of the origin"] = []
        return height_m - sea_m


def _has_place(item: PlanItem) -> bool:
    latitude_deg, longitude_deg = item.values[4:6]
    is_empty = not (latitude_deg or longitude_deg)
    return not (is_empty or (math.isnan(latitude_deg) and math.isnan(longitude_deg)))


def _names(items: Sequence[str]) -> str:
    more = f" and {len(items) - 3} more" if len(items) > 3 else ""
    return f": {', '.join(items[:3])}{more}" if items else ""
