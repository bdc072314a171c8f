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
from drone_mesh.earth_files.geojson import list_in, read_json
from drone_mesh.errors import ConfigurationError

MAX_PLAN_CHARACTERS = 1_500_000  # 1000 waypoints of a survey, as QGroundControl indents them
_VALUES = 7  # of an item: four numbers, latitude, longitude, height
_SEA, _HOME, _TERRAIN = (0, 5), (3, 6), (10, 11)  # MAV_FRAME of heights above these
_FRAMES = (*_SEA, *_HOME, *_TERRAIN)
_MODES = {1: _HOME, 2: _SEA, 3: _SEA, 4: _TERRAIN}  # by AltitudeMode of QGroundControl
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
    home: Sequence[float] | None = None  # latitude and longitude of the planned start
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
    speed: Any = mission.get("hoverSpeed")
    items: list[PlanItem] = []
    unread: list[str] = []
    for row in list_in(mission.get("items", []), "items"):
        item = _mapping(row, f"item {len(items) + 1}")
        parts: Any = [item]
        if item.get("type") != "SimpleItem":
            survey = item.get("TransectStyleComplexItem")
            parts = survey.get("Items") if isinstance(survey, dict) else None
            if not isinstance(parts, list):
                unread.append(
                    f"{reprlib.repr(item.get('complexItemType'))} after item {len(items)}"
                )
                continue
        for part in parts:
            items.append(_simple(part, f"item {len(items) + 1}"))
    return Plan(
        items,
        unread,
        _home(mission.get("plannedHomePosition")),
        float(speed) if _is_number(speed) and speed > 0 else None,
        _section(content, "geoFence"),
        _section(content, "rallyPoints"),
    )


def read_waypoints(text: str) -> Plan:
    """The items of a .waypoints file. Raises ConfigurationError, one line."""
    heading, *lines = text.splitlines() or [""]
    version = _HEADING.fullmatch(heading.strip())
    if version is None:
        raise ConfigurationError("line 1: expected QGC WPL 110")
    rows = [(f"line {number}", line.split()) for number, line in enumerate(lines, start=2)]
    items = [_item_of(row, where) for where, row in rows if row and not row[0].startswith("#")]
    has_home = version[1] == "110" and items
    return Plan(items[1:], home=_home(items[0].values[4:])) if has_home else Plan(items)


def _item_of(columns: Sequence[str], where: str) -> PlanItem:
    if len(columns) != _COLUMNS or not all(is_up_to(column, MOST) for column in columns[2:4]):
        raise ConfigurationError(
            f"{where}: expected {_COLUMNS} numbers, of which the third and fourth are whole"
        )
    try:
        values = [math.nan if text.lower() == "nan" else finite(text) for text in columns[4:11]]
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from error
    return PlanItem(where, int(columns[3]), int(columns[2]), values)


def _simple(part: Any, where: str) -> PlanItem:
    row = _mapping(part, where)
    values: Any = row.get("params")
    command, frame = row.get("command"), row.get("frame")
    is_list = isinstance(values, list) and len(values) == _VALUES
    if not is_list or not all(value is None or _is_number(value) for value in values):
        raise ConfigurationError(
            f"{where}: params {reprlib.repr(values)} are not {_VALUES} numbers"
        )
    if type(command) is not int or type(frame) is not int:
        raise ConfigurationError(f"{where}: needs a command and a frame, whole numbers")
    mode = row.get("AltitudeMode")
    if any(mode == of and frame in _FRAMES and frame not in its for of, its in _MODES.items()):
        # Which one the height is of is not told (qgroundcontrol#8910: above sea level in frame 3).
        raise ConfigurationError(f"{where}: frame {frame} does not go with AltitudeMode {mode}")
    return PlanItem(where, command, frame, [math.nan if v is None else float(v) for v in values])


def _home(place: Any) -> Sequence[float] | None:
    """None for a home that is not set, as 0, 0."""
    values = place[:2] if isinstance(place, list) else []
    is_set = len(values) == 2 and all(map(_is_number, values)) and any(values)
    return values if is_set else None


def _section(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    return _mapping(content.get(key) or {}, key)


def _mapping(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ConfigurationError(f"{what} is not an object: {reprlib.repr(value)}")
    return value


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= MOST  # false for nan
