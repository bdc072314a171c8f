"""The square in which pilots fly the drones of a simulation by a model of motion."""

from __future__ import annotations

import math

import pytest

from drone_mesh.mobility import Area
from drone_mesh.ros.world.pilots import area_around


def test_a_dense_fleet_gets_a_square_where_each_drone_has_ten_neighbours_of_a_uniform_fleet() -> (
    None
):
    x, y, side_m, depth_m = area_around([(float(n % 6), float(n // 6)) for n in range(18)], 9.0)
    assert side_m == depth_m == pytest.approx(20.4, abs=0.05)
    assert 18 / side_m**2 * math.pi * 9.0**2 == pytest.approx(11.0)  # itself, and ten others
    assert (x + side_m / 2, y + side_m / 2) == (2.5, 1.0)


def test_a_fleet_that_is_wider_gets_the_square_that_it_has() -> None:
    assert area_around([(0.0, 0.0), (60.0, 6.0)], 9.0) == Area(0.0, -27.0, 60.0, 60.0)
