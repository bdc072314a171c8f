"""A file of obstacles, and the error for a bad one."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from drone_mesh.air.obstacle_file import MAX_BOXES, read_obstacles, rows_of_file
from drone_mesh.air.obstacles import Box
from drone_mesh.drone.fleet import DEFAULT_ROUTERS, plan_fleet
from drone_mesh.errors import ConfigurationError

STREET = Path(__file__).parents[3] / "experiments" / "street.yaml"


def written(folder: Path, text: str) -> Path:
    path = folder / "boxes.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_box_has_the_place_size_angle_and_material_of_its_row(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "boxes:\n  - {center: [1, 2, 3.5], size: [4, 5, 7], yaw_deg: 90, material: wood}\n",
    )
    assert read_obstacles(path).boxes == [Box((1, 2, 3.5), (4, 5, 7), math.pi / 2, 4.0)]
    assert read_obstacles(path).blocks
    assert not read_obstacles(path, blocks=False).blocks


def test_the_street_of_the_experiments_can_stand_in_the_world() -> None:
    assert len(read_obstacles(STREET).boxes) == len(rows_of_file(STREET)) == 8


def test_no_drone_of_the_command_in_docs_flying_starts_inside_a_house() -> None:
    page = (STREET.parents[1] / "docs" / "flying.md").read_text(encoding="utf-8")
    found = re.search(r"obstacles:=experiments/street.yaml spacing:=(\d+) gridsize:=(\d+)`", page)
    assert found is not None
    street = read_obstacles(STREET)
    fleet = plan_fleet(1, DEFAULT_ROUTERS, int(found[2]), float(found[1]))
    assert [drone for _, _, *drone in fleet if not street.is_free((drone[0], drone[1], 0.1))] == []


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "expected 'boxes:' with a list"),
        ("boxes: 3\n", "line 1: expected 'boxes:' with a list"),
        ("houses: []\n", "line 1: unknown key houses; expected boxes"),
        ("boxes:\n  - 4\n", "line 2: invalid box 4"),
        ("boxes:\n  - {center: [1, 2, 3]}\n", r"line 2: boxes\[0\]: size is missing"),
        (
            "boxes:\n  - center: [1, 2]\n    size: [1, 1, 1]\n",
            r"line 2: boxes\[0\]: invalid center \[1, 2\]: expected three numbers",
        ),
        (
            "boxes:\n  - center: [1, 2, .nan]\n    size: [1, 1, 1]\n",
            r"line 2: boxes\[0\]: invalid center",
        ),
        (
            "boxes:\n  - center: [1, 2, 3]\n    size: [1, 0, 1]\n",
            r"line 3: boxes\[0\]: invalid size \[1, 0, 1\]: .* above 0",
        ),
        (
            "boxes:\n  - center: [1, 2, 3]\n    size: [1, 1, 1]\n    material: paper\n",
            r"line 4: boxes\[0\]: invalid material 'paper': expected brick or wood",
        ),
        (
            "boxes:\n  - {center: [1, 2, 3], size: [1, 1, 1]}\n"
            "  - center: [1, 2, 3]\n    size: [1, 1, 1]\n    colour: red\n",
            r"line 5: boxes\[1\]: unknown key colour; known are center, size",
        ),
        ("boxes: [" + "1," * (MAX_BOXES + 1) + "]\n", "at most 1000"),
        ("boxes: [\n", "line 2: "),
    ],
)
def test_a_bad_file_gives_one_line_with_file_line_and_key(
    tmp_path: Path, text: str, why: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigurationError, match=why) as caught:
        read_obstacles(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"none\.yaml: No such file"):
        read_obstacles(tmp_path / "none.yaml")
