"""A drone that an engine outside the world flies."""

from __future__ import annotations

from drone_mesh.drone.fleet import StartPlace
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.world.factory import RouterDrone
from drone_mesh.world.kinematic_world import KinematicWorld


def test_a_followed_drone_is_where_it_was_last_reported_and_its_listeners_are_notified() -> None:
    world = KinematicWorld()
    drone = RouterDrone(world, StartPlace(1, Role.ROUTER, 0.0, 0.0))
    states = []
    drone.engine.add_listener(states.append)
    drone.engine.follow((3.0, 4.0, 2.05))
    drone.engine.follow((3.0, 5.0, 2.05))
    world.step()
    assert world.centres[drone.box] == (3.0, 5.0, 2.05)
    assert drone.engine.get_location().distance_m(Location(5.0, 3.0, 2.0)) < 1e-9
    assert [state.position for state in states] == [(3.0, 5.0, 2.05)]
    world.step()
    assert len(states) == 1
