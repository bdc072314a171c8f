"""Layouts of the DroneManager: places of drones per case (docs/protocol.md, "Drone manager")."""

from __future__ import annotations

from pathlib import Path
from typing import Dict, Mapping, NamedTuple

from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import Location
from drone_mesh.errors import ConfigurationError, GoalRefused, MeshError
from drone_mesh.yaml_file import read_mapping

FIELD_CASE = 0
GRID_CASE = 100
MAX_CASE = 2**32 - 1  # Casus.srv: uint32 caseID
MAX_NODE_ID = 253  # docs/protocol.md, "Identity"

_FIELD_PLACES = {  # node id -> longitude, latitude: the field case of the project plan
    1: (-13, 24),
    2: (-11, 20),
    3: (-12, 14),
    4: (-7, 16),
    5: (-12, 7),
    6: (-7, 12),
    7: (-9, 5),
    8: (-5, 10),
    9: (-5, 5),
    10: (4, 9),
    11: (5, 5),
    12: (7, 13),
    13: (9, 7),
    14: (8, 20),
    15: (5, 25),
    16: (11, 25),
    17: (8, 26.5),
}
_GRID_DRONES = 100
_GRID_COLUMN = 10  # drones in a column along y
_GRID_SPACING_M = 5.0

Layout = Dict[int, Location]


class UnknownCase(MeshError):
    """There is no such layout. The message lists those there are: show it to whoever asked."""


class Order(NamedTuple):
    """Send this drone there."""

    node_id: int
    goal: Location


class Layouts:
    """All layouts that can be asked for, by case number."""

    def __init__(self, cases: Mapping[int, Layout]) -> None:
        """`cases` win over what is built in: 0, 1..17 and 100.

        1..17 move one drone to its place in case 0, whichever case 0 that is.
        """
        field = cases.get(FIELD_CASE, _field_layout())
        singles = {n: {n: field[n]} for n in _FIELD_PLACES if n in field}
        self._cases = {FIELD_CASE: field, **singles, GRID_CASE: _grid_layout(), **cases}

    @classmethod
    def load(cls, path: str | Path) -> Layouts:
        """Read a file like config/casus.yaml. ConfigurationError: file, place and what is wrong."""
        content = read_mapping(path)
        unknown = [str(key) for key in content if key != "cases"]
        if unknown:
            raise ConfigurationError(f"{path}: unknown key {unknown[0]}; want only 'cases'")
        cases = content.get("cases")
        if not isinstance(cases, dict):
            raise ConfigurationError(f"{path}: want 'cases:' with one layout for each case number")
        return cls({_case_id(path, case): _layout(path, case, cases[case]) for case in cases})

    @property
    def cases(self) -> list[int]:
        """The numbers of all cases, ascending."""
        return sorted(self._cases)

    def orders(self, case: int) -> list[Order]:
        """Who goes where, from the highest id down: the far end first, so that relays leave last.

        All places of the layout are ordered, also those of drones that do not exist: the manager
        cannot know who lives, and an order without a drone ends at the gateway, which logs that it
        has no route. Raises UnknownCase, which lists the known ones.
        """
        if case not in self._cases:
            raise UnknownCase(f"no case {case}; known are {_ranges(self.cases)}")
        return [Order(*item) for item in sorted(self._cases[case].items(), reverse=True)]


def _field_layout() -> Layout:
    return {n: Location(latitude=y, longitude=x, height=0.0) for n, (x, y) in _FIELD_PLACES.items()}


def _grid_layout() -> Layout:
    return {
        n: Location(
            latitude=_GRID_SPACING_M * ((n - 1) % _GRID_COLUMN),
            longitude=_GRID_SPACING_M * (1 + (n - 1) // _GRID_COLUMN),
            height=0.0,
        )
        for n in range(1, _GRID_DRONES + 1)
    }


def _is_id(value: object, highest: int) -> bool:
    return type(value) is int and 0 <= value <= highest  # a bool is an int as well, but no id


def _case_id(path: str | Path, case: object) -> int:
    if not _is_id(case, MAX_CASE):
        raise ConfigurationError(f"{path}: case {case!r} is not a whole number 0..{MAX_CASE}")
    assert isinstance(case, int)
    return case


def _layout(path: str | Path, case: int, content: object) -> Layout:
    where = f"{path}: case {case}"
    if not isinstance(content, dict) or not content:
        raise ConfigurationError(f"{where}: want 'node id: [longitude, latitude, height]' lines")
    layout: Layout = {}
    for node_id, place in content.items():
        if not _is_id(node_id, MAX_NODE_ID):
            raise ConfigurationError(
                f"{where}: {node_id!r} is not a node id, want 0..{MAX_NODE_ID}"
            )
        layout[node_id] = _place(f"{where}, drone {node_id}", place)
    return layout


def _place(where: str, content: object) -> Location:
    if (
        not isinstance(content, list)
        or len(content) != 3
        or not all(type(number) in (int, float) for number in content)
    ):
        raise ConfigurationError(
            f"{where}: {content!r} is not a place, want three numbers [longitude, latitude, height]"
        )
    longitude, latitude, height = map(float, content)
    try:
        check_goal(latitude, longitude, height)
    except GoalRefused as error:
        raise ConfigurationError(f"{where}: {error}") from error
    return Location(latitude=latitude, longitude=longitude, height=height)


def _ranges(numbers: list[int]) -> str:
    """Ascending numbers for people: 0..17, 100, 101."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        f"{run[0]}..{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs
    )
