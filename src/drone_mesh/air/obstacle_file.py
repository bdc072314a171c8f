"""Reads an obstacle file: the boxes in the world."""

# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].
import math
import reprlib
from pathlib import Path
from typing import Any, Dict, List, Tuple, Union

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from typing_extensions import Annotated, Literal

from drone_mesh.air.obstacles import CUT_DB, Box, Obstacles
from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import YamlFile, read_mapping

MAX_BOXES = 1000  # every view draws all of them
_EXPECTED = {
    "center": "three numbers, metres, each -10000..10000",
    "size": "three numbers, metres, each above 0, at most 10000",
    "yaw_deg": "a number of degrees, -360..360",
    "material": " or ".join(CUT_DB),
}

_Coordinate = Annotated[float, Field(ge=-10_000, le=10_000)]
_Edge = Annotated[float, Field(gt=0, le=10_000)]


class BoxRow(BaseModel):
    """One box as a file describes it, turned about its vertical axis by `yaw_deg`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    center: Annotated[List[_Coordinate], Field(min_length=3, max_length=3)]  # m
    size: Annotated[List[_Edge], Field(min_length=3, max_length=3)]  # m along x, y, z
    yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    material: Literal["brick", "wood", "window", "stone", "concrete"] = "brick"

    def to_box(self, brick_cut_db: float = CUT_DB["brick"]) -> Box:
        """The box; `brick_cut_db` is the loss per surface of brick, in dB."""
        (x, y, z), (long, wide, high) = self.center, self.size
        cut_db = brick_cut_db if self.material == "brick" else CUT_DB[self.material]
        return Box((x, y, z), (long, wide, high), math.radians(self.yaw_deg), cut_db)


def read_obstacles(path: Union[str, Path], blocks: bool = True) -> Obstacles:
    """The boxes in this file; with `blocks`, each box cuts the links that cross it.

    Raises ConfigurationError: one line with file, line, key and what is expected.
    """
    file = read_mapping(path)
    boxes = []
    for index, row in enumerate(_rows(file)):
        try:
            boxes.append(BoxRow.model_validate(row).to_box())
        except ValidationError as error:
            raise _explain(file, index, row, error) from None
    return Obstacles(boxes, blocks)


def rows_of_file(path: Path) -> List[Dict[str, Any]]:
    """The boxes of the file, unvalidated. Raises ConfigurationError with file, line and reason."""
    return _rows(read_mapping(path))


def _rows(file: YamlFile) -> List[Dict[str, Any]]:
    for key in file.content:
        if key != "boxes":
            raise ConfigurationError(f"{file.where(key)}: unknown key {key}; expected boxes")
    found = file.content.get("boxes")
    if not isinstance(found, list):
        raise ConfigurationError(f"{file.where('boxes')}: expected 'boxes:' with a list")
    if len(found) > MAX_BOXES:
        raise ConfigurationError(
            f"{file.where('boxes')}: {len(found)} boxes; at most {MAX_BOXES} are allowed"
        )
    return found


def _explain(file: YamlFile, index: int, row: Any, error: ValidationError) -> ConfigurationError:
    place: Tuple[Union[str, int], ...] = tuple(error.errors()[0]["loc"])
    where = file.where("boxes", index, *place[:1])
    if not place:
        return ConfigurationError(
            f"{where}: invalid box {reprlib.repr(row)}: expected {{center: [...], size: [...]}}"
        )
    key = str(place[0])
    if key not in _EXPECTED:
        known = ", ".join(_EXPECTED)
        return ConfigurationError(f"{where}: boxes[{index}]: unknown key {key}; known are {known}")
    if key not in row:
        return ConfigurationError(f"{where}: boxes[{index}]: {key} is missing")
    return ConfigurationError(
        f"{where}: boxes[{index}]: invalid {key} {reprlib.repr(row[key])}: "
        f"expected {_EXPECTED[key]}"
    )
