"""The condition of nodes and the problems of a mesh: decided here, and only displayed by views."""

from __future__ import annotations

import enum
import math
from collections import Counter
from dataclasses import dataclass
from typing import Mapping, Sequence

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
    found = ((node.id, *_worst_of(node, by_id)) for node in nodes)
    return [Trouble(*trouble) for trouble in found if trouble[1] is not Severity.OK]


def _worst_of(node: NodeStatus, by_id: Mapping[int, NodeStatus]) -> tuple[Severity, str]:
    condition, other = condition_of(node), another_radio(node.id) if node.shares_id else ""
    if condition is Condition.SILENT:
        return Severity.STALE, f"no report for {node.report_age:.0f} s"
    if condition is Condition.OFF:
        text = "battery empty" if node.battery == 0.0 else "switched off"
        return Severity.WARN, f"{other}: off until it is gone" if other else text
    if not node.connected:
        text = "flying" if condition is Condition.FLYING else "not connected to a gateway"
        return Severity.ERROR, ", ".join(filter(None, (other, "crashed" * node.crashed, text)))
    if other or node.crashed:
        return Severity.WARN, other or "crashed"
    if node.role == Role.ROUTER and not reaches_gateway(node.route, by_id):
        route = " > ".join(map(str, node.route))
        return Severity.WARN, f"its route breaks off: {route}" if route else "no route to a gateway"
    if node.outside_fence:
        return Severity.WARN, node.outside_fence
    if node.why_not_fly and math.isfinite(node.battery):
        return Severity.WARN, f"cannot fly: {node.why_not_fly}"
    return Severity.OK, ""


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
