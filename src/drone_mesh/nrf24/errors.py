"""Errors of a radio; their messages name the remedy."""

from __future__ import annotations

from drone_mesh.errors import MeshError


class RadioError(MeshError):
    """The transceiver is absent, miswired or has stopped answering: check wiring and supply."""


class HardwareUnavailable(RadioError):
    """This machine lacks a device or a library that the radio needs. Show the message and stop."""
