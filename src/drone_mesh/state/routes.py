"""Whole routes, assembled from the next hop that each node knows."""

from __future__ import annotations

from typing import Mapping, Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import NodeStatus


def route_to_gateway(start: int, nodes: Mapping[int, NodeStatus]) -> bytes:
    """Ids from `start` to a gateway, both included; empty when `start` is off or has no next hop.

    A route that loops, or leads to a node that is off or unknown, ends with the last id that could
    be followed, which shows where packets get stuck.
    """
    route = bytearray()
    here = start
    while here in nodes and here not in route:
        route.append(here)
        node = nodes[here]
        if node.role == Role.GATEWAY and node.on:
            return bytes(route)
        if not node.on or node.next_hop == NO_ROUTE:
            break
        here = node.next_hop
    return bytes(route) if len(route) > 1 else b""


def reaches_gateway(route: Sequence[int], nodes: Mapping[int, NodeStatus]) -> bool:
    """Whether this route ends at a gateway that is on."""
    end = nodes.get(route[-1]) if route else None
    return end is not None and end.role == Role.GATEWAY and end.on
