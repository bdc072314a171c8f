"""Nodes at one position, fanned out so that each can be seen and selected."""

from __future__ import annotations

import math
from typing import Sequence, Tuple

from drone_mesh.state.model import NodeStatus, position_is_known

COINCIDENT_M = 0.25  # closer than this, two drones of 0.2 m look like one

Slot = Tuple[int, int]  # number of the node in its group, from 0; size of the group


def fan_out(nodes: Sequence[NodeStatus]) -> dict[int, Slot]:
    """The slot of each node that shares its position, as seen from above, with others."""
    groups: dict[tuple[int, int], list[NodeStatus]] = {}
    for node in nodes:
        if position_is_known(node):
            _group_near(groups, node).append(node)
    return {
        node.id: (number, len(group))
        for group in groups.values()
        if len(group) > 1
        for number, node in enumerate(group)
    }


def fan_offset(slot: Slot, radius: float) -> tuple[float, float]:
    """The offset, right and up, at which discs of this radius in one group do not touch."""
    number, size = slot
    angle = math.pi / 2 - 2 * math.pi * number / size
    distance = 1.15 * radius / math.sin(math.pi / size)
    return (distance * math.cos(angle), distance * math.sin(angle))


def fanned_positions(
    nodes: Sequence[NodeStatus], radius_m: float
) -> dict[int, tuple[float, float, float]]:
    """Where to draw each node, in metres, if it fills a circle of this radius from above."""
    slots = fan_out(nodes)
    positions = {}
    for node in nodes:
        x, y, z = node.position
        right, up = fan_offset(slots[node.id], radius_m) if node.id in slots else (0.0, 0.0)
        positions[node.id] = (x + right, y + up, z)
    return positions


def _group_near(
    groups: dict[tuple[int, int], list[NodeStatus]], node: NodeStatus
) -> list[NodeStatus]:
    """The group whose first node is near; a new one if there is none. One group per cell."""
    x, y = node.position[0], node.position[1]
    column, row = math.floor(x / COINCIDENT_M), math.floor(y / COINCIDENT_M)
    for dx in (0, -1, 1):
        for dy in (0, -1, 1):
            group = groups.get((column + dx, row + dy))
            if group and math.dist(group[0].position[:2], (x, y)) < COINCIDENT_M:
                return group
    return groups.setdefault((column, row), [])
