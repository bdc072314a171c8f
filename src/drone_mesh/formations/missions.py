"""Missions: the flights of pilots, by drone, as a file or a request describes them."""

from __future__ import annotations

import reprlib
from pathlib import Path
from typing import Any, Callable, NamedTuple, Sequence

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.goal import check_goal
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.mobility.pilot import TrackPilot, along
from drone_mesh.yaml_file import YamlFile, is_number, is_whole_up_to, read_mapping

MOST_WAYPOINTS = 1000
MAX_SPEED_M_S = 20.0
KEYS = ("drones", "waypoints", "height", "speed", "loop")


class Mission(NamedTuple):
    """A flight over waypoints at one speed."""

    waypoints: Sequence[Vector]  # m, of the underside
    speed_m_s: float
    loop: bool  # from the last to the first again, and so on

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
        pilot = TrackPilot(along(self.waypoints, self.speed_m_s, self.loop), self.speed_m_s)
        begin = [] if here is None else [here, *pilot.way_back(here)]
        end = self.waypoints[:1] if self.loop else ()
        why_not = fence.why_not_straight([*begin, *self.waypoints, *end])
        if why_not:
            raise GoalRefused(why_not)
        return pilot


def read_missions(path: str | Path) -> dict[int, Mission]:
    """The missions in a file, by drone. Raises ConfigurationError: file, line and what is wrong.

    missions: [{drones: [1, 2], waypoints: [[x, y], ...], height: 3, speed: 0.5, loop: true}, ...]
    """
    file = read_mapping(path)
    rows = file.content.get("missions")
    if set(file.content) != {"missions"} or not isinstance(rows, list):
        raise ConfigurationError(f"{file.where('missions')}: expected 'missions:' with a list")
    missions: dict[int, Mission] = {}
    for index, row in enumerate(rows):
        drones, mission = _read(file, index, row)
        for drone in drones:
            if drone in missions:
                raise ConfigurationError(
                    f"{file.where('missions', index)}: drone {drone} has a mission already"
                )
            missions[drone] = mission
    return missions


def _read(file: YamlFile, index: int, row: Any) -> tuple[list[int], Mission]:
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
    places = value("waypoints", "a list of [x, y] in metres", lambda v: _is_list(v, _is_point))
    height = value("height", "a number of metres", is_number, 3.0)
    speed = value("speed", "a number of metres per second", is_number, 0.5)
    loop = value("loop", "true or false", lambda v: isinstance(v, bool), True)
    waypoints = [(float(x), float(y), float(height)) for x, y in places]
    mission = Mission(waypoints, float(speed), loop)
    try:
        mission.pilot()
    except GoalRefused as error:
        raise ConfigurationError(f"{file.where('missions', index)}: {error}") from None
    return drones, mission


def _is_id(value: object) -> bool:
    return is_whole_up_to(value, MAX_NODE_ID)


def _is_point(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def _is_list(value: object, fits: Callable[[object], bool]) -> bool:
    return isinstance(value, list) and bool(value) and all(map(fits, value))
