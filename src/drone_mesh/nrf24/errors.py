"""Errors of a radio; each message includes the remedy."""

from __future__ import annotations

from drone_mesh.errors import MeshError


class RadioError(MeshError):
    """The transceiver is absent, miswired or has stopped answering: check wiring and supply."""


class HardwareUnavailable(RadioError):
    """This machine lacks a device or library that the radio needs. Show the message and stop."""
