"""The one family of errors of this package."""

from __future__ import annotations


class MeshError(Exception):
    """Base of every error that this package raises on purpose."""


class PacketError(MeshError):
    """Bytes are not a packet we know. From the air this is normal: drop it and count it."""


class LocationUnknown(MeshError):
    """The drone engine cannot say where the drone is (reference 14.6). Go on without a position."""


class ConfigurationError(MeshError):
    """A parameter or a file is wrong. The message names it and what is allowed: show it, stop."""


class GoalRefused(MeshError):
    """A goal is no number or out of bounds (reference 11). Nothing moves; tell who sent it."""
