"""What a drone looks like."""

from __future__ import annotations

import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.view.bodies import MESHES
from drone_mesh.view.quadrocopter import MOTORS, ROTOR_HIGH_M, blade_ends, frame_file, lamp_file


def corners_of(*files: str) -> list[tuple[float, ...]]:
    """The corners of all triangles in these files, in metres."""
    lines = [line for file in files for line in (MESHES / file).read_text("ascii").splitlines()]
    return [tuple(map(float, line.split()[1:])) for line in lines if line.startswith("v ")]


@pytest.mark.parametrize("role", list(Role))
@pytest.mark.parametrize("is_flying", [False, True])
def test_a_drone_stands_on_its_origin_and_is_about_as_large_as_its_box(
    role: Role, is_flying: bool
) -> None:
    corners = corners_of(frame_file(is_flying), lamp_file(role))
    assert min(z for _, _, z in corners) == 0.0
    assert max(z for _, _, z in corners) == pytest.approx(role.size_m[2])
    for axis in (0, 1):
        width = max(c[axis] for c in corners) - min(c[axis] for c in corners)
        assert width == pytest.approx(0.2, abs=0.01)


def test_a_gateway_looks_different_from_a_router() -> None:
    assert corners_of(lamp_file(Role.GATEWAY)) != corners_of(lamp_file(Role.ROUTER))


def test_the_blades_of_a_drone_in_flight_turn_above_its_discs_and_about_its_motors() -> None:
    discs = corners_of(frame_file(True))
    assert max(z for _, _, z in discs) <= ROTOR_HIGH_M
    for x, y in MOTORS:
        (x0, y0), (x1, y1) = blade_ends((x, y), 0.7)
        assert ((x0 + x1) / 2, (y0 + y1) / 2) == pytest.approx((x, y))
