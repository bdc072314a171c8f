"""DroneFactory: start places, and drones added and removed (docs/ros.md, "Fleet")."""

from __future__ import annotations

import math

import pybullet
import pytest

from drone_mesh.air.obstacles import Box, Obstacles
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError, FleetRefused
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.factory import DroneFactory, GatewayDrone, RouterDrone


@pytest.fixture
def world():
    with BulletWorld() as world:
        yield world


@pytest.fixture
def make(world):
    def make(gateways=1, routers=3, gridsize=6, spacing=1.0, **more):
        return DroneFactory(world, plan_fleet(gateways, routers, gridsize, spacing), **more)

    return make


def test_ids_count_gateways_first_and_then_routers(make):
    drones = make(gateways=2, routers=3).drones
    assert [drone.node_id for drone in drones] == [0, 1, 2, 3, 4]
    assert [type(drone) for drone in drones] == [GatewayDrone] * 2 + [RouterDrone] * 3
    assert [drone.role for drone in drones] == [Role.GATEWAY] * 2 + [Role.ROUTER] * 3


def test_gateways_stand_in_a_column_and_routers_in_rows(make):
    centres = [
        drone.engine.state.position
        for drone in make(gateways=2, routers=5, gridsize=3, spacing=6.0).drones
    ]
    assert centres == [
        (-1.0, 0.0, 0.1),
        (-1.0, 1.0, 0.1),
        (0.0, 0.0, 0.05),
        (6.0, 0.0, 0.05),
        (12.0, 0.0, 0.05),
        (0.0, 6.0, 0.05),
        (6.0, 6.0, 0.05),
    ]


def test_each_drone_starts_with_its_underside_on_the_ground(make):
    assert [drone.engine.get_location() for drone in make(routers=2).drones] == [
        Location(latitude=0.0, longitude=-1.0, height=0.0),
        Location(latitude=0.0, longitude=0.0, height=0.0),
        Location(latitude=0.0, longitude=1.0, height=0.0),
    ]


def test_each_kind_of_drone_has_a_box_of_its_own_size(world, make):
    for drone, size in zip(make(routers=1).drones, ((0.2, 0.1, 0.2), (0.2, 0.2, 0.1))):
        (shape,) = pybullet.getCollisionShapeData(drone.box, -1, physicsClientId=world.client)
        assert shape[2:4] == (pybullet.GEOM_BOX, pytest.approx(size))
        low, high = pybullet.getAABB(drone.box, physicsClientId=world.client)
        assert [b - a for a, b in zip(low, high)] == pytest.approx(size, abs=0.01)


def test_an_empty_world_and_a_full_one_are_allowed(make):
    assert make(gateways=0, routers=0).drones == ()
    assert len(make(gateways=0, routers=254).drones) == 254


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"gateways": -1}, "invalid gateways -1: must be 0 or more"),
        ({"routers": -1}, "invalid routers -1: must be 0 or more"),
        (
            {"gateways": 1, "routers": 254},
            r"gateways \+ routers: 1 \+ 254 = 255 drones, .* at most 254",
        ),
        ({"gridsize": 0}, "invalid gridsize 0"),
        ({"spacing": 0.0}, "invalid spacing 0.0"),
        ({"spacing": -1.0}, "invalid spacing -1.0"),
        ({"spacing": math.nan}, "invalid spacing nan"),
        ({"spacing": math.inf}, "invalid spacing inf"),
    ],
)
def test_a_parameter_for_an_impossible_fleet_is_named(make, changes, why):
    with pytest.raises(ConfigurationError, match=why):
        make(**changes)


def ids(fleet):
    return [drone.node_id for drone in fleet.drones]


def test_a_new_drone_stands_at_its_place_with_the_lowest_free_id(make):
    fleet = make()
    drone = fleet.add(Role.ROUTER, longitude=14.0, latitude=-2.0)
    assert (drone.node_id, drone.role) == (4, Role.ROUTER)
    assert drone.engine.state.position == (14.0, -2.0, 0.05)
    assert ids(fleet) == [0, 1, 2, 3, 4]


def test_an_id_that_was_removed_is_the_lowest_free_one(make):
    fleet = make()
    fleet.remove(2)
    assert ids(fleet) == [0, 1, 3]
    assert fleet.add(Role.GATEWAY, 14.0, 0.0).node_id == 2
    assert [drone.role for drone in fleet.drones if drone.node_id == 2] == [Role.GATEWAY]


def test_drones_are_listed_by_id_whatever_the_order_in_which_they_were_added(make):
    fleet = make()
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
def test_what_cannot_be_added_is_refused_and_changes_nothing(
    make, longitude, latitude, node_id, why
):
    fleet = make()
    with pytest.raises(FleetRefused, match=why):
        fleet.add(Role.ROUTER, longitude, latitude, node_id)
    assert ids(fleet) == [0, 1, 2, 3]


def test_a_place_against_an_obstacle_is_refused(make):
    box = Box(center=(20.0, 0.0, 1.0), size=(2.0, 2.0, 2.0))
    fleet = make(obstacles=Obstacles([box]))
    with pytest.raises(FleetRefused, match="x 18.9 m, y 0 m is in or against a box"):
        fleet.add(Role.ROUTER, 18.9, 0.0)
    assert fleet.add(Role.ROUTER, 18.8, 0.0).node_id == 4


def test_a_place_outside_the_fence_is_refused(make):
    yard = Zone("yard", (((-30.0, -30.0), (30.0, -30.0), (30.0, 30.0), (-30.0, 30.0)),))
    fleet = make(obstacles=Obstacles((), fence=Fence.of([yard], [])))
    with pytest.raises(FleetRefused, match="x 40 m, y 0 m is outside fence yard"):
        fleet.add(Role.ROUTER, 40.0, 0.0)
    assert fleet.add(Role.ROUTER, 20.0, 0.0).node_id == 4


def test_a_full_fleet_takes_no_more(make):
    fleet = make(gateways=0, routers=254)
    with pytest.raises(FleetRefused, match="the fleet is full"):
        fleet.add(Role.ROUTER, 500.0, 500.0)


def test_a_drone_that_does_not_exist_cannot_be_removed(make):
    with pytest.raises(FleetRefused, match="drone 4 does not exist"):
        make().remove(4)


def test_the_last_gateway_stays_while_there_are_routers(make):
    fleet = make(gateways=2, routers=1)
    fleet.remove(0)
    with pytest.raises(FleetRefused, match="drone 1 is the last gateway"):
        fleet.remove(1)
    fleet.remove(2)
    fleet.remove(1)
    assert fleet.drones == ()


@pytest.mark.parametrize("wind", [None, (0.0, 0.0, 0.0)])
def test_a_drone_that_is_removed_in_flight_disappears_and_disturbs_no_other(world, make, wind):
    fleet = make(wind=wind)
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
