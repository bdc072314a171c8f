"""Files of ground stations: plans of QGroundControl (.plan), and waypoint files (.waypoints).

.plan: QGroundControl's developer guide, "Plan File Format". .waypoints: mavlink.io, "File Formats".
Both hold MAVLink mission items, here as they stand: who flies them judges them.
"""

from __future__ import annotations

import math
import re
import reprlib
from typing import Any, Mapping, NamedTuple, Sequence

from drone_mesh.arguments import MOST, finite, is_up_to
from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.earth_files.geojson import read_json
from drone_mesh.errors import ConfigurationError

MAX_PLAN_CHARACTERS = 1_500_000  # 1000 waypoints of a survey, as QGroundControl indents them
_VALUES = 7  # of an item: four numbers, latitude, longitude, height
_COLUMNS = 12  # of a line: index, current, frame, command, the values, autocontinue
# MissionController of QGroundControl: in 110 the first item is the planned home, 120 has none.
_HEADING = re.compile(r"QGC\s+WPL\s+(110|120)")


class PlanItem(NamedTuple):
    """A MAVLink mission item."""

    where: str  # in its file, such as "item 3"
    command: int  # MAV_CMD
    frame: int  # MAV_FRAME, of its place
    values: Sequence[float]  # its seven parameters; nan: not given


class Plan(NamedTuple):
    """The content of a file. Places are in degrees (WGS84) and metres."""

    items: Sequence[PlanItem]
    unread: Sequence[str] = ()  # what it has beside them, in words
    home: EarthPlace | None = None  # where its author planned the start; altitude nan: not given
    speed_m_s: float | None = None
    geo_fence: Mapping[str, Any] = {}  # as in the file; of a .plan only
    rally_points: Mapping[str, Any] = {}


def read_plan(text: str) -> Plan:
    """The simple items of a .plan, with those of surveys and corridor scans.

    Raises ConfigurationError, one line.
    """
    content = _mapping(read_json(text), "the plan")
    if content.get("fileType") != "Plan":
        raise ConfigurationError("not a plan of QGroundControl: its fileType is not Plan")
    mission = _section(content, "mission")
    if mission.get("version", 2) != 2:
        version = reprlib.repr(mission["version"])
        raise ConfigurationError(
            f"a mission of version {version}, not 2: save it with a newer QGroundControl"
        )
    items: list[PlanItem] = []
    unread: list[str] = []
    for row in _list(mission.get("items", []), "items"):
        kind = _mapping(row, f"item {len(items) + 1}").get("type")
        if kind == "SimpleItem":
            items.append(_simple(row, len(items) + 1))
            continue
        survey = row.get("TransectStyleComplexItem")
        parts = survey.get("Items") if isinstance(survey, dict) else None
        if not isinstance(parts, list):
            name = row.get("complexItemType") or kind
            unread.append(f"{reprlib.repr(name)} after item {len(items)}")
        for part in parts if isinstance(parts, list) else ():
            items.append(_simple(_mapping(part, f"item {len(items) + 1}"), len(items) + 1))
    return Plan(
        items,
        unread,
        _home(mission.get("plannedHomePosition")),
        _speed(mission.get("hoverSpeed")),
        _section(content, "geoFence"),
        _section(content, "rallyPoints"),
    )


def read_waypoints(text: str) -> Plan:
    """The items of a .waypoints file. Raises ConfigurationError, one line."""
    heading, *lines = text.splitlines() or [""]
    version = _HEADING.fullmatch(heading.strip())
    if version is None:
        raise ConfigurationError("line 1: expected QGC WPL 110")
    items = []
    for number, line in enumerate(lines, start=2):
        columns = line.split()
        if columns and not columns[0].startswith("#"):
            items.append(_item_of(columns, f"line {number}"))
    home = None
    if version[1] == "110" and items:
        home = EarthPlace(*items.pop(0).values[4:])
    return Plan(items, home=home)


def _item_of(columns: Sequence[str], where: str) -> PlanItem:
    if len(columns) != _COLUMNS:
        raise ConfigurationError(f"{where}: {len(columns)} values, expected {_COLUMNS}")
    numbers = [column for column in columns[2:4] if is_up_to(column, MOST)]
    if len(numbers) != 2:
        raise ConfigurationError(f"{where}: frame and command are not whole numbers")
    try:
        values = [math.nan if text.lower() == "nan" else finite(text) for text in columns[4:11]]
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from error
    return PlanItem(where, int(numbers[1]), int(numbers[0]), values)


def _simple(row: Mapping[str, Any], number: int) -> PlanItem:
    where = f"item {number}"
    values = _list(row.get("params"), f"{where}: its params")
    if len(values) == 4 and "coordinate" in row:  # as in 2017
        values = values + _list(row["coordinate"], f"{where}: its coordinate")
    if len(values) != _VALUES or not all(value is None or _is_number(value) for value in values):
        raise ConfigurationError(
            f"{where}: its params are not {_VALUES} numbers: {reprlib.repr(values)}"
        )
    command, frame = row.get("command"), row.get("frame")
    if not (type(command) is int and type(frame) is int and 0 <= command <= MOST):
        raise ConfigurationError(f"{where}: needs a command and a frame, whole numbers")
    return PlanItem(where, command, frame, [math.nan if v is None else float(v) for v in values])


def _home(place: Any) -> EarthPlace | None:
    values = [*place, None][:3] if isinstance(place, list) else []
    if len(values) < 3 or not all(map(_is_number, values[:2])):
        return None
    return EarthPlace(values[0], values[1], values[2] if _is_number(values[2]) else math.nan)


def _speed(value: Any) -> float | None:
    return float(value) if _is_number(value) and value > 0 else None


def _section(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    return _mapping(content.get(key) or {}, key)


def _mapping(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ConfigurationError(f"{what} is not an object: {reprlib.repr(value)}")
    return value


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise ConfigurationError(f"{what} {reprlib.repr(value)} are not a list")
    return value


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= MOST  # false for nan
