"""DroneFactory: ids, roles, start places, sizes and colours (docs/ros.md, "Fleet")."""

from __future__ import annotations

import math

import pybullet
import pytest

from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.factory import DroneFactory, GatewayDrone, RouterDrone
from drone_mesh.world.kinematic_world import KinematicWorld


def make(**changes):
    parameters = {"gateways": 1, "routers": 17, "gridsize": 6, "spacing": 1.0}
    return DroneFactory(KinematicWorld(), plan_fleet(**{**parameters, **changes}))


def test_ids_count_gateways_first_and_then_routers():
    drones = make(gateways=2, routers=3).drones
    assert [drone.node_id for drone in drones] == [0, 1, 2, 3, 4]
    assert [type(drone) for drone in drones] == [GatewayDrone] * 2 + [RouterDrone] * 3
    assert [drone.role for drone in drones] == [Role.GATEWAY] * 2 + [Role.ROUTER] * 3


def test_gateways_stand_in_a_column_and_routers_in_rows():
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


def test_each_drone_starts_with_its_underside_on_the_ground():
    assert [drone.engine.get_location() for drone in make(routers=2).drones] == [
        Location(latitude=0.0, longitude=-1.0, height=0.0),
        Location(latitude=0.0, longitude=0.0, height=0.0),
        Location(latitude=0.0, longitude=1.0, height=0.0),
    ]


def test_each_kind_of_drone_has_a_box_of_its_own_size():
    with BulletWorld() as world:
        gateway, router = DroneFactory(world, plan_fleet(1, 1, gridsize=1, spacing=1.0)).drones
        for drone, size in ((gateway, (0.2, 0.1, 0.2)), (router, (0.2, 0.2, 0.1))):
            (shape,) = pybullet.getCollisionShapeData(drone.box, -1, physicsClientId=world.client)
            assert shape[2] == pybullet.GEOM_BOX
            assert shape[3] == pytest.approx(size)
            low, high = pybullet.getAABB(drone.box, physicsClientId=world.client)
            assert [b - a for a, b in zip(low, high)] == pytest.approx(size, abs=0.01)


def test_an_empty_world_and_a_full_one_are_allowed():
    assert make(gateways=0, routers=0).drones == ()
    assert make(gateways=1, routers=253).drones[-1].node_id == 253
    assert len(make(gateways=0, routers=254).drones) == 254


def test_each_drone_starts_at_a_place_of_its_own():
    places = [
        (place.longitude, place.latitude) for place in plan_fleet(4, 250, gridsize=16, spacing=1.0)
    ]
    assert len(set(places)) == 254


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
def test_a_parameter_for_an_impossible_fleet_is_named(changes, why):
    with pytest.raises(ConfigurationError, match=why):
        make(**changes)
