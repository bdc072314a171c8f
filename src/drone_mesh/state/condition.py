"""What condition a node is in: decided here, and only shown by every view."""

from __future__ import annotations

import enum

from drone_mesh.state.model import NodeStatus

SILENT_AFTER_S = 5.0  # our choice: a host reports twice a second, ten reports are missing then


class Condition(enum.Enum):
    """What one can expect of a node now. The value is the word that people see."""

    CONNECTED = "connected"
    CRASHED = "crashed"  # its drone never flies again; its node may go on working
    FLYING = "flying"
    DISCONNECTED = "disconnected"  # on, and looking for a gateway
    OFF = "off"
    SILENT = "silent"  # the process that hosts it has stopped reporting: its state is not known


def condition_of(node: NodeStatus) -> Condition:
    """The first that holds: silent, off, crashed, flying, connected; else disconnected."""
    if node.report_age >= SILENT_AFTER_S:
        return Condition.SILENT
    if not node.on:
        return Condition.OFF
    if node.crashed:
        return Condition.CRASHED
    if len(node.path):
        return Condition.FLYING
    return Condition.CONNECTED if node.connected else Condition.DISCONNECTED
