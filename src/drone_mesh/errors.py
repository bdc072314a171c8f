"""The errors of this package, in one family."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Iterator


class MeshError(Exception):
    """Base of every error that this package raises on purpose."""


class PacketError(MeshError):
    """Bytes are not a known packet. From the air this is normal: drop it and count it."""


class LocationUnknown(MeshError):
    """The drone engine does not know where the drone is. Continue without a position."""


class ConfigurationError(MeshError):
    """A parameter or a file is invalid. Show the message, which says what is allowed, and stop."""


@contextlib.contextmanager
def naming_argument(argument: str, path: str | Path) -> Iterator[None]:
    """Put an argument in front of each MeshError about its file.

    `argument`: what the user wrote before the path, such as "casus:=" or "--key-file ".
    """
    try:
        yield
    except MeshError as error:
        if not str(error).startswith(str(path)):
            raise
        raise type(error)(f"{argument}{error}") from error


class FleetRefused(MeshError):
    """A drone cannot be added or removed. The fleet is unchanged; report it to the user."""


class MessageRefused(MeshError):
    """A user's message cannot be sent. Nothing was sent; report it to the user."""


class QueueFull(MessageRefused):
    """Too many users' messages wait in this node. Try again after some have been sent."""


class GoalRefused(MeshError):
    """A goal is invalid, out of bounds or unreachable. Nothing moves; report it to the sender."""


class PlaceTaken(GoalRefused):
    """Another drone is at the goal, or will be there. The order may say that this is meant."""

    def __init__(self, reason: str, drone: int) -> None:
        """`drone`: the other one."""
        super().__init__(reason)
        self.drone = drone
