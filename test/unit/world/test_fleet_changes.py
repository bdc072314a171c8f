"""DroneFactory: adding drones to a fleet and removing them (docs/ros.md, "Fleet")."""

from __future__ import annotations

import math

import pytest

from drone_mesh.air.obstacles import Box, Obstacles
from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.roles import Role
from drone_mesh.errors import FleetRefused
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.factory import DroneFactory
from drone_mesh.world.kinematic_world import KinematicWorld


def factory(world=None, gateways=1, routers=3, **more):
    return DroneFactory(world or KinematicWorld(), plan_fleet(gateways, routers, 6, 1.0), **more)


def ids(fleet):
    return [drone.node_id for drone in fleet.drones]


def test_a_new_drone_stands_at_its_place_with_the_lowest_free_id():
    fleet = factory()
    drone = fleet.add(Role.ROUTER, longitude=14.0, latitude=-2.0)
    assert (drone.node_id, drone.role) == (4, Role.ROUTER)
    assert drone.engine.state.position == (14.0, -2.0, 0.05)
    assert ids(fleet) == [0, 1, 2, 3, 4]


def test_an_id_that_was_removed_is_the_lowest_free_one():
    fleet = factory()
    fleet.remove(2)
    assert ids(fleet) == [0, 1, 3]
    assert fleet.add(Role.GATEWAY, 14.0, 0.0).node_id == 2
    assert [drone.role for drone in fleet.drones if drone.node_id == 2] == [Role.GATEWAY]


def test_drones_are_listed_by_id_whatever_the_order_in_which_they_were_added():
    fleet = factory()
    fleet.add(Role.ROUTER, 14.0, 0.0, node_id=253)
    fleet.add(Role.ROUTER, 15.0, 0.0, node_id=7)
    assert ids(fleet) == [0, 1, 2, 3, 7, 253]


@pytest.mark.parametrize(
    ("longitude", "latitude", "node_id", "why"),
    [
        (9.0, 9.0, 2, "drone 2 exists already; the lowest free id is 4"),
        (9.0, 9.0, 254, "invalid drone id 254: must be 0..253"),
        (9.0, 9.0, -1, "invalid drone id -1: must be 0..253"),
        (math.nan, 9.0, None, "invalid place: longitude nan is not a finite number"),
        (9.0, 5001.0, None, "invalid place: latitude 5001 m is outside -5000..5000 m"),
        (1.1, 0.1, None, "invalid place: drone 2 is there"),
    ],
)
def test_what_cannot_be_added_is_refused_and_changes_nothing(longitude, latitude, node_id, why):
    fleet = factory()
    with pytest.raises(FleetRefused, match=why):
        fleet.add(Role.ROUTER, longitude, latitude, node_id)
    assert ids(fleet) == [0, 1, 2, 3]


def test_a_place_against_an_obstacle_is_refused():
    box = Box(center=(20.0, 0.0, 1.0), size=(2.0, 2.0, 2.0))
    fleet = factory(obstacles=Obstacles([box]))
    with pytest.raises(FleetRefused, match="x 18.9 m, y 0 m is in or against an obstacle"):
        fleet.add(Role.ROUTER, 18.9, 0.0)
    assert fleet.add(Role.ROUTER, 18.8, 0.0).node_id == 4


def test_a_full_fleet_takes_no_more():
    fleet = factory(gateways=0, routers=254)
    with pytest.raises(FleetRefused, match="the fleet is full"):
        fleet.add(Role.ROUTER, 500.0, 500.0)


def test_a_drone_that_does_not_exist_cannot_be_removed():
    with pytest.raises(FleetRefused, match="drone 4 does not exist"):
        factory().remove(4)


def test_the_last_gateway_stays_while_there_are_routers():
    fleet = factory(gateways=2, routers=1)
    fleet.remove(0)
    with pytest.raises(FleetRefused, match="drone 1 is the last gateway"):
        fleet.remove(1)
    fleet.remove(2)
    fleet.remove(1)
    assert fleet.drones == ()


def test_a_fleet_without_gateways_can_lose_its_routers():
    fleet = factory(gateways=0, routers=2)
    fleet.remove(0)
    fleet.remove(1)
    assert fleet.drones == ()


@pytest.mark.parametrize("wind", [None, (0.0, 0.0, 0.0)])
def test_a_drone_that_is_removed_in_flight_disappears_and_disturbs_no_other(wind):
    with BulletWorld() as world:
        fleet = factory(world, wind=wind)
        engine = fleet.drones[3].engine
        heard = []
        engine.add_listener(heard.append)
        engine.set_goal(latitude=10.0, longitude=0.0, height=0.0)
        for _ in range(50):
            world.step()
        assert heard
        fleet.remove(3)
        heard.clear()
        engine.set_goal(latitude=20.0, longitude=0.0, height=0.0)  # from a thread that is late
        new = fleet.add(Role.ROUTER, 30.0, 0.0)
        for _ in range(50):
            world.step()
        assert heard == []
        assert new.engine.state.position == pytest.approx((30.0, 0.0, 0.05), abs=0.01)
