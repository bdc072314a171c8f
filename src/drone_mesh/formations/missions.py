"""Missions: the flights of pilots, by drone, as a file or a request describes them."""

from __future__ import annotations

import logging
import reprlib
from pathlib import Path
from typing import Any, Callable, NamedTuple, Sequence

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.goal import check_goal
from drone_mesh.earth_files import is_earth_file
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.formations.mission_files import MOST_WAYPOINTS, DrawnMission, read_mission_file
from drone_mesh.mobility.pilot import TrackPilot, along, stops_along
from drone_mesh.yaml_file import YamlFile, is_number, is_whole_up_to, read_mapping

MAX_SPEED_M_S = 20.0
DEFAULT_SPEED_M_S = 0.5  # of a file that says none
KEYS = ("drones", "waypoints", "file", "height", "speed", "loop")


_log = logging.getLogger(__name__)


class Mission(NamedTuple):
    """A flight over waypoints at one speed."""

    waypoints: Sequence[Vector]  # m, of the underside
    speed_m_s: float
    loop: bool  # from the last to the first again, and so on

    @classmethod
    def drawn(
        cls, drawn: DrawnMission, speed_m_s: float | None, height_m: float | None, loop: bool
    ) -> Mission:
        """The mission in a file, at this speed and height instead of its own.

        Raises GoalRefused for one that lies on the ground.
        """
        places = drawn.waypoints
        if height_m is not None:
            is_flat = not any(z for _x, _y, z in places)  # otherwise it lands at 0
            places = [(x, y, height_m if z or is_flat else 0.0) for x, y, z in places]
        elif not any(z for _x, _y, z in places):
            raise GoalRefused("its waypoints have no height: say at which height to fly it")
        speeds = (speed_m_s, drawn.speed_m_s, DEFAULT_SPEED_M_S)
        return cls(places, next(speed for speed in speeds if speed is not None), loop)

    def pilot(
        self,
        fence: Fence = Fence(),  # noqa: B008 (frozen)
        here: Vector | None = None,
    ) -> TrackPilot:
        """A pilot who flies it from `here`, if that is given.

        Raises GoalRefused for a mission that cannot be flown within the fence.
        """
        if not 1 <= len(self.waypoints) <= MOST_WAYPOINTS:
            raise GoalRefused(f"{len(self.waypoints)} waypoints: use 1..{MOST_WAYPOINTS}")
        if not 0 < self.speed_m_s <= MAX_SPEED_M_S:
            raise GoalRefused(
                f"speed {self.speed_m_s:g} m/s: must be above 0, at most {MAX_SPEED_M_S:g}"
            )
        for x, y, height in self.waypoints:
            check_goal(y, x, height)
        way = (self.waypoints, self.speed_m_s, self.loop)
        pilot = TrackPilot(along(*way), self.speed_m_s, stops_along(*way))
        begin = [] if here is None else [here, *pilot.way_back(here)]
        end = self.waypoints[:1] if self.loop else ()
        why_not = fence.why_not_straight([*begin, *self.waypoints, *end])
        if why_not:
            raise GoalRefused(why_not)
        return pilot


def read_missions(path: str | Path, origin: Origin | None = None) -> dict[int, Mission]:
    """The missions in a file, by drone. Raises ConfigurationError: file, line and what is wrong.

    missions: [{drones: [1, 2], waypoints: [[x, y], ...], height: 3, speed: 0.5, loop: true},
    {drones: [3], file: survey.plan}, ...], where `file` lies beside it and may have its own height
    and speed. Logs what is told of such a file.
    """
    if is_earth_file(str(path)):
        raise ConfigurationError(
            f"{path}: says not which drone flies it: name both in a file of missions, such as "
            f"'missions: [{{drones: [3], file: {Path(path).name}}}]'"
        )
    file = read_mapping(path)
    rows = file.content.get("missions")
    if set(file.content) != {"missions"} or not isinstance(rows, list):
        raise ConfigurationError(f"{file.where('missions')}: expected 'missions:' with a list")
    missions: dict[int, Mission] = {}
    for index, row in enumerate(rows):
        drones, mission = _read(file, index, row, origin)
        for drone in drones:
            if drone in missions:
                raise ConfigurationError(
                    f"{file.where('missions', index)}: drone {drone} has a mission already"
                )
            missions[drone] = mission
    return missions


def _read(file: YamlFile, index: int, row: Any, origin: Origin | None) -> tuple[list[int], Mission]:
    if not isinstance(row, dict) or not set(row) <= set(KEYS):
        raise ConfigurationError(
            f"{file.where('missions', index)}: expected a mission with {', '.join(KEYS)}, "
            f"not {reprlib.repr(row)}"
        )

    def value(key: str, expected: str, fits: Callable[[Any], bool], default: Any = None) -> Any:
        found = row.get(key, default)
        if not fits(found):
            raise ConfigurationError(
                f"{file.where('missions', index, key)}: invalid {key} {reprlib.repr(found)}: "
                f"expected {expected}"
            )
        return found

    drones = value("drones", "a list of ids", lambda v: _is_list(v, _is_id))
    is_drawn = "file" in row and "waypoints" not in row
    height = value("height", "a number of metres", _is_number_or_none, None if is_drawn else 3.0)
    speed = value("speed", "a number of metres per second", _is_number_or_none)
    loop = value("loop", "true or false", lambda v: isinstance(v, bool), not is_drawn)
    if is_drawn:
        name = value("file", "the name of a file", lambda v: isinstance(v, str))
        drawn = read_mission_file(Path(file.path).parent / name, origin)
        level = logging.WARNING if drawn.notes else logging.INFO
        _log.log(level, "%s: %s", name, drawn.in_words())
    else:
        places = value("waypoints", "a list of [x, y] in metres", lambda v: _is_list(v, _is_point))
        drawn = DrawnMission([(float(x), float(y), 0.0) for x, y in places], None, [])
    try:
        mission = Mission.drawn(drawn, speed, height, loop)
        mission.pilot()
    except GoalRefused as error:
        raise ConfigurationError(f"{file.where('missions', index)}: {error}") from None
    return drones, mission


def _is_id(value: object) -> bool:
    return is_whole_up_to(value, MAX_NODE_ID)


def _is_number_or_none(value: object) -> bool:
    return value is None or is_number(value)


def _is_point(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def _is_list(value: object, fits: Callable[[object], bool]) -> bool:
    return isinstance(value, list) and bool(value) and all(map(fits, value))
