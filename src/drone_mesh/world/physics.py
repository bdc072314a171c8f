"""The world of a simulation: pybullet's, or one without physics."""

from __future__ import annotations

import importlib.util

from drone_mesh.errors import ConfigurationError
from drone_mesh.world.worlds import World


def require_pybullet(purpose: str) -> None:
    """Raise ConfigurationError if pybullet is not installed."""
    if importlib.util.find_spec("pybullet") is None:
        raise ConfigurationError(
            f"{purpose} needs pybullet: pip install --use-pep517 -r requirements/physics.txt "
            "(Python 3.12 and newer: pip builds it from source, some minutes)"
        )


def open_world(dynamic: bool) -> World:
    """A BulletWorld if physics is to move the drones (`dynamic`), and otherwise a World.

    Raises ConfigurationError if the first needs pybullet, which is missing.
    """
    if not dynamic:
        return World()
    require_pybullet("flight dynamic")
    from drone_mesh.world.bullet_world import BulletWorld

    return BulletWorld()
