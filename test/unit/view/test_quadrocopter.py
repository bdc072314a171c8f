"""What a drone looks like, and that the meshes for rviz are what the code makes."""

from __future__ import annotations

import runpy
from collections import Counter
from pathlib import Path

import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.view.quadrocopter import BodyPart, solid_of
from drone_mesh.view.solids import dome, normal, polygon, prism

ROOT = Path(__file__).parents[3]
MESHES = ROOT / "meshes"


def test_the_meshes_of_rviz_are_those_that_the_code_makes() -> None:
    on_disk = {path.name: path.read_text("ascii") for path in MESHES.iterdir()}
    script = runpy.run_path(str(ROOT / "scripts" / "meshes"))
    assert on_disk == script["mesh_files"](), "run scripts/meshes"


@pytest.mark.parametrize("role", list(Role))
def test_a_drone_stands_on_its_origin_and_is_about_as_large_as_its_box(role: Role) -> None:
    corners = [c for part in BodyPart for triangle in solid_of(role, part) for c in triangle]
    assert min(z for _, _, z in corners) == 0.0
    assert max(z for _, _, z in corners) == pytest.approx(role.size_m[2])
    for axis in (0, 1):
        width = max(c[axis] for c in corners) - min(c[axis] for c in corners)
        assert width == pytest.approx(0.2, abs=0.01)


def test_a_gateway_looks_different_from_a_router() -> None:
    lamps = {role: solid_of(role, BodyPart.LAMP) for role in Role}
    assert lamps[Role.GATEWAY] != lamps[Role.ROUTER]


def test_a_prism_is_closed_and_faces_outwards() -> None:
    solid = prism(polygon((1.0, 2.0), 0.5, 6), 0.0, 3.0)
    edges = Counter((t[i], t[(i + 1) % 3]) for t in solid for i in range(3))
    assert all(count == 1 and edges[end, start] == 1 for (start, end), count in edges.items())
    for triangle in solid:
        middle = [sum(corner[i] for corner in triangle) / 3 for i in range(3)]
        outward = [here - center for here, center in zip(middle, (1.0, 2.0, 1.5))]
        assert sum(a * b for a, b in zip(normal(triangle), outward)) > 0


def test_a_dome_faces_upwards() -> None:
    assert all(normal(triangle)[2] > 0 for triangle in dome(1.0, 0.0, 0.5, 12, 4))
