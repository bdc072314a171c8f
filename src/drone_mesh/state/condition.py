"""The condition of nodes and the problems of a mesh: decided here, and only displayed by views."""

from __future__ import annotations

import enum
import math
from collections import Counter
from dataclasses import dataclass
from typing import Sequence

from drone_mesh.drone.roles import Role
from drone_mesh.state.links import reaches_gateway
from drone_mesh.state.model import NodeStatus, another_radio

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


class Severity(enum.IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Trouble:
    """The most severe problem of one node."""

    node: int
    severity: Severity
    text: str


@dataclass(frozen=True)
class Summary:
    """The mesh in one line."""

    severity: Severity
    text: str


def find_trouble(nodes: Sequence[NodeStatus]) -> list[Trouble]:
    """One entry for each node with a problem, by id."""
    by_id = {node.id: node for node in nodes}
    troubles = []
    for node in nodes:
        condition = condition_of(node)
        if condition is Condition.SILENT:
            troubles.append(
                Trouble(node.id, Severity.STALE, f"no report for {node.report_age:.0f} s")
            )
        elif condition is Condition.OFF:
            text = "battery empty" if node.battery == 0.0 else "switched off"
            text = f"{another_radio(node.id)}: off until it is gone" if node.shares_id else text
            troubles.append(Trouble(node.id, Severity.WARN, text))
        elif not node.connected:
            text = "flying" if condition is Condition.FLYING else "not connected to a gateway"
            if node.crashed:
                text = f"crashed, {text}"
            if node.shares_id:
                text = f"{another_radio(node.id)}, {text}"
            troubles.append(Trouble(node.id, Severity.ERROR, text))
        elif node.shares_id:
            troubles.append(Trouble(node.id, Severity.WARN, another_radio(node.id)))
        elif node.crashed:
            troubles.append(Trouble(node.id, Severity.WARN, "crashed"))
        elif node.role == Role.ROUTER and not reaches_gateway(node.route, by_id):
            route = " > ".join(map(str, node.route))
            text = f"its route breaks off: {route}" if route else "no route to a gateway"
            troubles.append(Trouble(node.id, Severity.WARN, text))
        elif node.why_not_fly and math.isfinite(node.battery):
            troubles.append(Trouble(node.id, Severity.WARN, f"cannot fly: {node.why_not_fly}"))
    return troubles


def summarise(nodes: Sequence[NodeStatus], troubles: Sequence[Trouble]) -> Summary:
    """How many of the routers that are on have a gateway, and the worst severity."""
    if not nodes:
        return Summary(Severity.STALE, "no nodes")
    conditions = {node.id: condition_of(node) for node in nodes}
    routers = [
        node
        for node in nodes
        if node.role == Role.ROUTER and conditions[node.id] not in (Condition.OFF, Condition.SILENT)
    ]
    counts = Counter(conditions.values())
    numbers = {
        "switched off": counts[Condition.OFF],
        "silent": counts[Condition.SILENT],
        "crashed": sum(node.crashed for node in nodes),
    }
    parts = [f"{sum(node.connected for node in routers)} of {len(routers)} routers connected"]
    parts += [f"{number} {what}" for what, number in numbers.items() if number]
    worst = max((trouble.severity for trouble in troubles), default=Severity.OK)
    jammed = sum(node.jammed for node in nodes)
    if jammed:
        parts.append(f"radio channel jammed at {jammed}")
    return Summary(worst, ", ".join(parts))


def all_connected(troubles: Sequence[Trouble]) -> bool:
    """Whether every node that is on is connected.

    Nodes that are switched off do not count; a silent one counts as not connected.
    """
    return all(trouble.severity <= Severity.WARN for trouble in troubles)
