"""The condition of a node: decided here, and only displayed by every view."""

from __future__ import annotations

import enum

from drone_mesh.state.model import NodeStatus

SILENT_AFTER_S = 5.0  # ten missed reports, since a host reports twice a second


class Condition(enum.Enum):
    """The condition of a node. The value is the word that views display."""

    CONNECTED = "connected"
    CRASHED = "crashed"  # its drone never flies again, but its node may still work
    FLYING = "flying"
    DISCONNECTED = "disconnected"  # on, and looking for a gateway
    OFF = "off"
    SILENT = "silent"  # the process that hosts it has stopped reporting: its state is unknown


def condition_of(node: NodeStatus) -> Condition:
    """The first that applies: silent, off, crashed, flying, connected, disconnected."""
    if node.report_age >= SILENT_AFTER_S:
        return Condition.SILENT
    if not node.on:
        return Condition.OFF
    if node.crashed:
        return Condition.CRASHED
    if len(node.path):
        return Condition.FLYING
    return Condition.CONNECTED if node.connected else Condition.DISCONNECTED
