"""Drones of the world fly over or round obstacles, or refuse; and bodies hit them."""

from __future__ import annotations

import pytest

from drone_mesh.air.obstacles import Box, Obstacles
from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.dynamic_engine import DynamicEngine
from drone_mesh.world.factory import DroneFactory

TOWER = Box((3.0, 0.0, 3.0), (1.0, 1.0, 6.0))  # between the two routers, higher than their climb


WALL = Box((3.0, 0.0, 2.0), (1.0, 60.0, 4.0))  # too long to go round, higher than their climb

BOTH_KINDS = pytest.mark.parametrize("wind", [None, (0.0, 0.0, 0.0)], ids=["kinematic", "dynamic"])


@pytest.fixture
def world():
    with BulletWorld() as world:
        yield world


def fleet(world, box, wind=None):
    return DroneFactory(world, plan_fleet(0, 2, 2, 6.0), wind, Obstacles([box])).drones


def fly_past(world, box, wind):
    """The places at the obstacle of a drone that flies to the other side."""
    engine = fleet(world, box, wind)[0].engine
    engine.set_goal(1.0, 5.0, 0)
    places = []
    engine.add_listener(lambda state: places.append(state.position))
    world.step()
    while engine.state.is_flying:
        assert world.now_s < 60.0
        world.step()
    assert engine.get_location().distance_m(Location(1.0, 5.0, 0.0)) < 0.3
    assert not engine.crashed
    return [place for place in places if abs(place[0] - 3.0) < 0.5]


@BOTH_KINDS
def test_a_flight_goes_over_a_wall(world, wind):
    assert min(z for _x, _y, z in fly_past(world, WALL, wind)) > 4.3


@BOTH_KINDS
def test_a_flight_goes_round_a_tower(world, wind):
    beside = [(y, z) for _x, y, z in fly_past(world, TOWER, wind)]
    assert min(abs(y) for y, _z in beside) > 0.7  # half the tower and some of the clearance
    assert max(z for _y, z in beside) < 4.0


def test_a_goal_in_or_against_a_box_is_refused_with_the_reason(world):
    drone, _ = fleet(world, TOWER)
    for x in (3.0, 3.6):
        with pytest.raises(GoalRefused, match=r"no path past the obstacles: x 3.* m, y 0 m, z 1 m"):
            drone.engine.set_goal(0.0, x, 1)
    world.step()
    assert not drone.engine.state.is_flying


def test_a_drone_under_a_roof_refuses_to_climb_through_it(world):
    roof = Box((0.0, 0.0, 2.0), (2.0, 2.0, 0.2))
    drone, other = fleet(world, roof)
    with pytest.raises(GoalRefused, match="no path past the obstacles"):
        drone.engine.set_goal(3.0, 3.0, 0)
    other.engine.set_goal(3.0, 3.0, 0)


def test_a_drone_that_would_start_against_a_box_ends_the_start_with_one_line(world):
    with pytest.raises(ConfigurationError, match="drone 1 would start in or against a box, at x 6"):
        fleet(world, Box((6.6, 0.0, 1.0), (1.0, 1.0, 2.0)))


def test_a_body_that_flies_into_a_box_crashes_and_does_not_pass_through_it(world):
    world.add_obstacle(TOWER)
    body = world.add_body((0.2, 0.2, 0.1), (0.0, 0.0, 1.0), 1.0)
    engine = DynamicEngine(world, body, (0.0, 0.0, 1.0), 0.05)
    engine._hover = Location.from_vector((12.0, 0.0, 1.0))  # straight through the tower
    for _ in range(500):
        world.step()
        assert engine.state.position[0] < 2.5
    assert engine.crashed
    assert engine.get_location().height < 0.05  # it fell
