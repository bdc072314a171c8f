"""What is wrong with a mesh, in words: the source of diagnostics, exit codes and red rows."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Sequence

from drone_mesh.drone.roles import Role
from drone_mesh.state.model import NodeStatus
from drone_mesh.state.routes import reaches_gateway

SILENT_AFTER_S = 5.0  # our choice: a host reports twice a second, ten reports are missing then


class Severity(enum.IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Trouble:
    """One node and the worst that can be said about it."""

    node: int
    severity: Severity
    text: str


@dataclass(frozen=True)
class Summary:
    """The mesh in one line."""

    severity: Severity
    text: str


def find_trouble(nodes: Sequence[NodeStatus]) -> list[Trouble]:
    """One entry for each node with trouble, by id."""
    by_id = {node.id: node for node in nodes}
    troubles = []
    for node in nodes:
        if node.report_age >= SILENT_AFTER_S:
            troubles.append(
                Trouble(node.id, Severity.STALE, f"no report for {node.report_age:.0f} s")
            )
        elif not node.on:
            troubles.append(Trouble(node.id, Severity.WARN, "switched off"))
        elif not node.connected:
            what = "flying" if len(node.path) else "not connected to a gateway"
            troubles.append(Trouble(node.id, Severity.ERROR, what))
        elif node.role == Role.ROUTER and not reaches_gateway(node.route, by_id):
            way = " > ".join(map(str, node.route))
            what = f"its route ends nowhere: {way}" if way else "no route to a gateway"
            troubles.append(Trouble(node.id, Severity.WARN, what))
    return troubles


def summarise(nodes: Sequence[NodeStatus], troubles: Sequence[Trouble]) -> Summary:
    """How many routers that are on have a gateway, and the worst severity among the troubles."""
    if not nodes:
        return Summary(Severity.STALE, "no nodes")
    silent = {trouble.node for trouble in troubles if trouble.severity == Severity.STALE}
    routers = [
        node for node in nodes if node.role == Role.ROUTER and node.on and node.id not in silent
    ]
    connected = sum(node.connected for node in routers)
    parts = [f"{connected} of {len(routers)} routers connected"]
    off = sum(not node.on and node.id not in silent for node in nodes)
    if off:
        parts.append(f"{off} switched off")
    if silent:
        parts.append(f"{len(silent)} silent")
    worst = max((trouble.severity for trouble in troubles), default=Severity.OK)
    return Summary(worst, ", ".join(parts))


def everybody_is_connected(troubles: Sequence[Trouble]) -> bool:
    """Whether each node that should be connected is: one that is switched off need not be."""
    return all(trouble.severity <= Severity.WARN for trouble in troubles)
