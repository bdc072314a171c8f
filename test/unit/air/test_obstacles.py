"""Boxes in the way of radio and drones."""

from __future__ import annotations

import math
import random

import pytest

from drone_mesh.air.obstacles import BOX_CLEARANCE_M, Box, Obstacles

WALL = Box(center=(5.0, 0.0, 1.5), size=(0.2, 4.0, 3.0))


def test_a_segment_through_a_box_is_inside_it_for_its_width() -> None:
    assert WALL.chord((0, 0, 1), (10, 0, 1)) == pytest.approx((0.49, 0.51))
    assert WALL.chord((0, 0, 1), (4, 0, 1)) is None
    assert WALL.chord((0, 3, 1), (10, 3, 1)) is None
    assert WALL.chord((0, 0, 4), (10, 0, 4)) is None


def test_a_rotated_box_lies_at_its_angle() -> None:
    turned = Box((5.0, 0.0, 1.5), (0.2, 4.0, 3.0), yaw_rad=math.pi / 2)  # along x now
    assert turned.chord((5, -3, 1), (5, 3, 1)) == pytest.approx((2.9 / 6, 3.1 / 6))
    assert turned.chord((5.5, -3, 1), (5.5, 3, 1)) is not None
    assert WALL.chord((5.5, -3, 1), (5.5, 3, 1)) is None


def test_a_box_that_blocks_ends_the_link() -> None:
    obstacles = Obstacles([WALL])
    assert obstacles.margin_db((0, 0, 1), (8, 0, 1), 9.0) == -math.inf
    assert obstacles.margin_db((0, 0, 1), (4, 0, 1), 9.0) > 0


def test_a_wall_attenuates_by_its_decibels_per_surface_and_per_metre() -> None:
    obstacles = Obstacles([WALL], blocks=False)
    assert obstacles.loss_db((0, 0, 1), (8, 0, 1)) == pytest.approx(2 * 9.0 + 0.2 * 0.4)
    assert obstacles.loss_db((0, 0, 1), (5, 0, 1)) == pytest.approx(9.0 + 0.1 * 0.4)
    assert obstacles.loss_db((0, 0, 1), (4, 0, 1)) == 0.0


@pytest.mark.parametrize(("loss_db", "reach_m"), [(4.0, 5.7), (9.0, 3.2), (15.0, 1.6)])
def test_behind_a_wall_the_range_shrinks_as_in_free_space(loss_db: float, reach_m: float) -> None:
    """One surface of loss_db between them: the node at the origin stands inside the box."""
    box = Box((0.0, 0.0, 0.0), (0.02, 9.0, 9.0), cut_db=loss_db)
    obstacles = Obstacles([box], blocks=False, metre_db=0.0)
    assert obstacles.margin_db((0, 0, 0), (reach_m - 0.06, 0, 0), 9.0) > 0
    assert obstacles.margin_db((0, 0, 0), (reach_m + 0.06, 0, 0), 9.0) < 0


def test_both_directions_are_the_same_to_the_last_bit() -> None:
    rng = random.Random(1)
    boxes = [
        Box(
            (rng.uniform(0, 40), rng.uniform(0, 40), 3.0), (rng.uniform(1, 8), 4.0, 6.0),
            rng.uniform(0, 3),
        )
        for _ in range(12)
    ]  # fmt: skip
    obstacles = Obstacles(boxes, blocks=False)
    damped = 0
    for _ in range(1000):
        a, b = ((rng.uniform(0, 40), rng.uniform(0, 40), rng.uniform(0, 5)) for _ in range(2))
        assert obstacles.loss_db(a, b) == obstacles.loss_db(b, a)
        damped += obstacles.loss_db(a, b) > 0
    assert damped > 100


# Flights


LONG_HOUSE = Box((10.0, 0.0, 10.0), (4.0, 80.0, 20.0))
TOWER = Box((10.0, 0.0, 10.0), (4.0, 4.0, 20.0))


def test_a_flight_climbs_over_what_is_long() -> None:
    path = Obstacles([LONG_HOUSE]).plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0)
    assert path is not None
    assert path.around == ()
    assert path.above_start[2] == pytest.approx(20 + BOX_CLEARANCE_M, abs=1e-3)
    assert path.duration_s == pytest.approx((20 + 2 * (20.5 - 10)) / 2.0, abs=1e-3)
    for share in range(101):
        place = path.position_at(path.duration_s * share / 100)
        assert not LONG_HOUSE.contains(place)


@pytest.mark.parametrize("ceiling_m", [500.0, 15.0])
def test_a_flight_goes_round_what_is_high_and_takes_the_time_of_the_detour(
    ceiling_m: float,
) -> None:
    path = Obstacles([TOWER], ceiling_m=ceiling_m).plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0)
    assert path is not None
    assert [corner[2] for corner in path.across] == [10.0] * 4
    side = math.copysign(2.51, path.around[0][1])
    for corner, expected in zip(path.around, [(7.49, side), (12.51, side)]):
        assert corner == pytest.approx(expected)
    assert len(path.around) == 2
    round_m = 2 * math.hypot(7.49, 2.51) + 5.02
    assert path.ground_m == pytest.approx(round_m)
    assert path.duration_s == pytest.approx(round_m / 2.0)
    for share in range(101):
        place = path.position_at(path.duration_s * share / 100)
        assert not TOWER.grown(BOX_CLEARANCE_M).contains(place)


def test_a_low_wall_with_a_tower_in_it_is_crossed_over_the_wall() -> None:
    wall = Box((10.0, 0.0, 6.0), (2.0, 80.0, 12.0))
    obstacles = Obstacles([wall, TOWER], ceiling_m=15.0)
    path = obstacles.plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0)
    assert path is not None
    assert path.around
    assert path.above_start[2] == pytest.approx(12.5, abs=1e-3)
    for share in range(101):
        assert obstacles.is_free(path.position_at(path.duration_s * share / 100))


def test_no_path_leads_out_of_a_yard_as_high_as_the_ceiling() -> None:
    walls = [
        Box((x, y, 10.0), (12.0, 1.0, 20.0), yaw)
        for x, y, yaw in ((0, 5, 0.0), (0, -5, 0.0), (5, 0, math.pi / 2), (-5, 0, math.pi / 2))
    ]
    yard = Obstacles(walls, ceiling_m=19.0)
    assert yard.plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0) is None
    assert yard.plan_flight((0, 0, 0), (2, 2, 0), 0.0, 2.0) is not None
    assert Obstacles(walls).plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0) is not None


def test_a_flight_above_or_beside_a_box_is_the_same_as_without_it() -> None:
    house = Box((10.0, 30.0, 10.0), (4.0, 4.0, 20.0))
    path = Obstacles([house]).plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0)
    assert path is not None
    assert path.above_start[2] == 10.0
    assert path.duration_s == 10.0


def test_no_path_leads_into_a_box_or_up_through_one_or_over_the_ceiling() -> None:
    roof = Box((0.0, 0.0, 5.0), (4.0, 4.0, 1.0))
    assert Obstacles([TOWER]).plan_flight((0, 0, 0), (10, 0, 0), 0.0, 2.0) is None
    assert Obstacles([roof]).plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0) is None
    low = Obstacles([LONG_HOUSE], ceiling_m=11.0)
    assert low.plan_flight((0, 0, 0), (20, 0, 0), 0.0, 2.0) is not None  # round its end
    assert low.plan_flight((0, 0, 0), (24, 0, 0), 0.0, 2.0) is None  # this far it climbs 12 m
    assert low.plan_flight((0, 45, 0), (20, 45, 0), 0.0, 2.0) is not None


def test_no_flight_ever_passes_through_a_box() -> None:
    rng = random.Random(3)
    boxes = [
        Box(
            (rng.uniform(0, 60), rng.uniform(0, 60), h / 2), (rng.uniform(2, 9), 5.0, h),
            rng.uniform(0, 3),
        )
        for h in (rng.uniform(2, 25) for _ in range(15))
    ]  # fmt: skip
    obstacles = Obstacles(boxes)
    flown = 0
    while flown < 300:
        start, goal = ((rng.uniform(0, 60), rng.uniform(0, 60), 0.0) for _ in range(2))
        if not obstacles.is_free(start):
            continue
        path = obstacles.plan_flight(start, goal, 0.0, 2.0)
        if path is None:
            assert not obstacles.is_free(goal)
            continue
        flown += 1
        for share in range(201):
            assert obstacles.is_free(path.position_at(path.duration_s * share / 200))
