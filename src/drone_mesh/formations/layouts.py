"""Layouts of the DroneManager: positions of drones, by case (docs/ros.md, "Drone manager")."""

from __future__ import annotations

import reprlib
import sys
from pathlib import Path
from typing import Any, Dict, Mapping, NamedTuple

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, GoalRefused, MeshError
from drone_mesh.yaml_file import (
    YamlFile,
    is_number,
    is_whole_up_to,
    read_mapping,
    read_mapping_text,
)

FIELD_CASE = 0
GRID_CASE = 100
MAX_CASE = 2**32 - 1  # Casus.srv: uint32 caseID
MAX_NAME = 100  # characters, of a formation

_FIELD_PLACES = {  # node id -> longitude, latitude: the field case of the project plan
    1: (-13, 24), 2: (-11, 20), 3: (-12, 14), 4: (-7, 16), 5: (-12, 7), 6: (-7, 12),
    7: (-9, 5), 8: (-5, 10), 9: (-5, 5), 10: (4, 9), 11: (5, 5), 12: (7, 13),
    13: (9, 7), 14: (8, 20), 15: (5, 25), 16: (11, 25), 17: (8, 26.5),
}  # fmt: skip
_GRID_DRONES = 100
_GRID_COLUMN = 10  # drones in a column along y
_GRID_SPACING_M = 5.0

Layout = Dict[int, Location]


class UnknownCase(MeshError):
    """There is no such layout. The message lists those that exist."""


class Order(NamedTuple):
    """Sends a drone to a goal."""

    node_id: int
    goal: Location


class Layouts:
    """All known layouts, by case number."""

    def __init__(self, cases: Mapping[int, Layout]) -> None:
        """`cases` override the built-in ones: 0, 1..17 and 100.

        Cases 1..17 move one drone to its position in case 0, whether built-in or overridden.
        """
        field = cases.get(FIELD_CASE, _field_layout())
        singles = {n: {n: field[n]} for n in _FIELD_PLACES if n in field}
        self._cases = {FIELD_CASE: field, **singles, GRID_CASE: _grid_layout(), **cases}

    @classmethod
    def shipped(cls) -> Layouts:
        """The layouts in config/casus.yaml, from a checkout or an installed wheel."""
        places = (Path(__file__).resolve().parents[3], Path(sys.prefix) / "share" / "drone_mesh")
        files = (place / "config" / "casus.yaml" for place in places)
        return next((cls.load(file) for file in files if file.exists()), cls({}))

    @classmethod
    def load(cls, path: str | Path) -> Layouts:
        """Read a file like config/casus.yaml. ConfigurationError: file, line and what is wrong."""
        return cls(_cases(read_mapping(path)))

    @property
    def cases(self) -> list[int]:
        """The numbers of all cases, ascending."""
        return sorted(self._cases)

    def orders(self, case: int) -> list[Order]:
        """The orders of a case by descending id: the far end first, so relays leave last.

        They include drones that do not exist: the manager cannot know which do, and the
        gateway logs that it has no route for such an order. Raises UnknownCase, which lists the
        known ones.
        """
        if case not in self._cases:
            raise UnknownCase(f"unknown case {case}: use one of {ids_in_words(self.cases, 3)}")
        return [Order(*item) for item in sorted(self._cases[case].items(), reverse=True)]


def read_layout(text: str, name: str = "the file") -> list[Order]:
    """The orders of a layout file with one case, by descending id.

    Raises ConfigurationError: `name`, line and what is wrong.
    """
    cases = _cases(read_mapping_text(text, name))
    if len(cases) != 1:
        raise ConfigurationError(f"{name}: has {len(cases)} cases: keep the one to fly to")
    (layout,) = cases.values()
    return [Order(*item) for item in sorted(layout.items(), reverse=True)]


def _cases(file: YamlFile) -> dict[int, Layout]:
    for key in file.content:
        if key != "cases":
            raise ConfigurationError(f"{file.where(key)}: unknown key {key}: expected only 'cases'")
    cases = file.content.get("cases")
    if not isinstance(cases, dict):
        raise ConfigurationError(
            f"{file.where('cases')}: expected 'cases:' with one layout per case number"
        )
    for case in cases:
        if not is_whole_up_to(case, MAX_CASE):
            raise ConfigurationError(
                f"{file.where('cases', case)}: invalid case {case!r}: "
                f"must be a whole number 0..{MAX_CASE}"
            )
    return {case: _layout(file, case, places) for case, places in cases.items()}


def _layout(file: YamlFile, case: int, places: Any) -> Layout:
    if not isinstance(places, dict) or not places:
        raise ConfigurationError(
            f"{file.where('cases', case)}: case {case}: "
            "expected 'node id: [longitude, latitude, height]' lines"
        )
    layout: Layout = {}
    for node_id, place in places.items():
        where = file.where("cases", case, node_id)
        if not is_whole_up_to(node_id, MAX_NODE_ID):
            raise ConfigurationError(
                f"{where}: case {case}: invalid node id {node_id!r}: must be 0..{MAX_NODE_ID}"
            )
        if not (isinstance(place, list) and len(place) == 3 and all(map(is_number, place))):
            raise ConfigurationError(
                f"{where}: case {case}, drone {node_id}: invalid place {reprlib.repr(place)}: "
                "expected three numbers [longitude, latitude, height]"
            )
        longitude, latitude, height = map(float, place)
        try:
            check_goal(latitude, longitude, height)
        except GoalRefused as error:
            raise ConfigurationError(f"{where}: case {case}, drone {node_id}: {error}") from error
        layout[node_id] = Location(latitude, longitude, height)
    return layout


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
