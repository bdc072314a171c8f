"""The world that this machine can have: pybullet's, or one without physics."""

from __future__ import annotations

import importlib.util
import logging

from drone_mesh.errors import ConfigurationError
from drone_mesh.world.worlds import World

_log = logging.getLogger(__name__)


def require_pybullet(purpose: str) -> None:
    """Raise ConfigurationError if pybullet is not installed."""
    if not _is_installed():
        raise ConfigurationError(
            f"{purpose} needs pybullet: pip install --use-pep517 -r requirements/physics.txt "
            "(Python 3.12 and newer: pip builds it from source, some minutes)"
        )


def open_world(dynamic: bool) -> World:
    """A BulletWorld. Without pybullet a World without physics, in which a flight looks the same.

    Raises ConfigurationError if physics is to move the drones (`dynamic`) and pybullet is missing.
    """
    if dynamic:
        require_pybullet("flight dynamic")
    elif not _is_installed():
        _log.info("pybullet is not installed: the world is kinematic, and flight dynamic needs it")
        return World()
    from drone_mesh.world.bullet_world import BulletWorld

    return BulletWorld()


def _is_installed() -> bool:
    return importlib.util.find_spec("pybullet") is not None
