"""Rays through the boxes of a pybullet world give the links of the in-process network."""

from __future__ import annotations

import random

import numpy as np
import pytest

from drone_mesh.air.box import Box
from drone_mesh.air.node_table import NodeTable
from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.world.ray_links import RayLinks

RANGE_M = 9.0
PAIRS = 1000


def a_town(rng: random.Random) -> list[Box]:
    return [
        Box(
            (rng.uniform(0, 30), rng.uniform(0, 30), height / 2),
            (rng.uniform(0.2, 5), rng.uniform(0.2, 5), height),
            rng.uniform(0, 3),
            rng.choice((4.0, 7.0, 9.0, 15.0)),
        )
        for height in (rng.uniform(1, 8) for _ in range(25))
    ]


def a_free_pair_in_range(rng: random.Random, obstacles: Obstacles) -> tuple[Vector, Vector]:
    while True:
        a = (rng.uniform(0, 30), rng.uniform(0, 30), rng.uniform(0, 6))
        b = (a[0] + rng.uniform(-9, 9), a[1] + rng.uniform(-9, 9), rng.uniform(0, 6))
        near = np.linalg.norm(np.subtract(a, b)) < RANGE_M
        if near and obstacles.is_free(a) and obstacles.is_free(b):
            return a, b


@pytest.mark.parametrize("blocks", [True, False], ids=["block", "wall"])
def test_a_thousand_random_pairs_have_the_same_links_by_ray_and_in_process(blocks: bool) -> None:
    rng = random.Random(5)
    obstacles = Obstacles(a_town(rng), blocks)
    rays = RayLinks(obstacles, RANGE_M)
    network = Network(seed=1)
    network.air.sees = lambda a, b: obstacles.margin_db(a.to_vector(), b.to_vector(), RANGE_M) > 0
    linked = 0
    for _ in range(PAIRS):
        a, b = a_free_pair_in_range(rng, obstacles)
        in_process = network.air.sees(Location.from_vector(a), Location.from_vector(b))
        by_ray = rays.sees(a, np.array([b]))[0]
        assert by_ray == in_process == rays.sees(b, np.array([a]))[0], (a, b)
        linked += in_process
    rays.close()
    assert 0.2 * PAIRS < linked < 0.9 * PAIRS  # neither an empty town nor a solid one


def test_many_places_checked_at_once_give_the_same_as_one_by_one() -> None:
    rng = random.Random(6)
    obstacles = Obstacles(a_town(rng), blocks=False)
    rays = RayLinks(obstacles, RANGE_M)
    here = (12.0, 12.0, 5.0)
    others = np.array([(rng.uniform(8, 16), rng.uniform(8, 16), 0.05) for _ in range(100)])
    together = rays.sees(here, others)
    assert list(together) == [bool(rays.sees(here, other[None])[0]) for other in others]
    assert 0 < together.sum() < 100
    rays.close()


def test_a_wall_in_the_simulated_air_hides_nodes_from_each_other_until_one_flies_over_it() -> None:
    wall = Box((2.5, 0.0, 1.0), (0.2, 20.0, 2.0))
    rays = RayLinks(Obstacles([wall]), RANGE_M)
    table = NodeTable(RANGE_M, rays.sees)
    for node, x in ((1, 0.0), (2, 5.0), (3, 1.0)):
        table.drone_info(node, (x, 0.0, 0.05), "", True)
        table.drone_info(node, (0.0, 0.0, 0.0), f"/Node/{node}", True)
    assert table.in_range(1) == (3,)
    assert table.link(1, 2) is None
    assert table.link(2, 1) is None
    assert table.link(1, 1) == "/Node/1"  # an antenna's probe for its own registration
    table.drone_info(2, (5.0, 0.0, 6.0), "", True)
    assert table.in_range(1) == (2, 3)
    assert table.link(2, 1) == "/Node/1"
    rays.close()
