"""Which world a machine can have: with pybullet, and without."""

from __future__ import annotations

import importlib.util

import pytest

from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.errors import ConfigurationError
from drone_mesh.world.factory import DroneFactory
from drone_mesh.world.physics import open_world, require_pybullet
from drone_mesh.world.worlds import PhysicalWorld


@pytest.fixture
def without_pybullet(monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pybullet" else find_spec(name)
    )


def flown(world):
    """The places of a drone on its flight, once a second."""
    with world:
        (drone,) = DroneFactory(world, plan_fleet(1, 0, 1, 1.0)).drones
        drone.engine.set_goal(latitude=4.0, longitude=3.0, height=2.0)
        places = []
        for _ in range(12):
            for _ in range(100):
                world.step()
            places.append(drone.engine.state.position)
        return places


def test_a_drone_flies_the_same_path_without_pybullet(without_pybullet, monkeypatch):
    without = flown(open_world(dynamic=False))
    monkeypatch.undo()
    world = open_world(dynamic=False)
    assert isinstance(world, PhysicalWorld)
    assert flown(world) == without
    assert without[-1] == pytest.approx((3.0, 4.0, 2.1))


def test_what_needs_physics_says_what_is_missing(without_pybullet):
    with pytest.raises(ConfigurationError, match="flight dynamic needs pybullet: pip install"):
        open_world(dynamic=True)
    with pytest.raises(ConfigurationError, match="snapshot needs pybullet: pip install"):
        require_pybullet("snapshot")
