"""The one family of errors of this package."""

from __future__ import annotations


class MeshError(Exception):
    """Base of every error that this package raises on purpose."""


class PacketError(MeshError):
    """Bytes are not a packet we know. From the air this is normal: drop it and count it."""


class LocationUnknown(MeshError):
    """The drone engine does not know where the drone is. Continue without a position."""


class ConfigurationError(MeshError):
    """A parameter or a file is wrong. The message names it and what is allowed: show it, stop."""


class FleetRefused(MeshError):
    """A drone cannot be added or removed. The fleet is as it was; report it to the user."""


class MessageRefused(MeshError):
    """A user's message cannot be sent as it is. Nothing was sent; report it to the user."""


class QueueFull(MessageRefused):
    """Too many messages of users wait in this node. Try again when some of them have left."""


class GoalRefused(MeshError):
    """A goal is not a number or out of bounds. Nothing moves; report it to the sender."""
