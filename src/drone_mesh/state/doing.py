"""What each node does now, in a few words: for lists of a whole fleet."""

from __future__ import annotations

from collections import Counter
from typing import Iterable

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition, condition_of
from drone_mesh.state.model import NodeStatus, position_is_known, waypoints


def doings(nodes: Iterable[NodeStatus]) -> dict[int, str]:
    """By node: its flight, repair, mission, or whose packets it forwards; empty: nothing."""
    nodes = tuple(nodes)
    others = Counter(on_route for node in nodes for on_route in node.route[1:])
    coming = {node.relieves: node.id for node in nodes if node.relieves != NO_ROUTE}
    return {
        node.id: "; ".join(
            filter(None, (_relief(node, coming.get(node.id)), _doing(node, others[node.id])))
        )
        for node in nodes
    }


def _relief(node: NodeStatus, coming: int | None) -> str:
    """Whose place it takes, or that `coming` takes its place; empty: neither."""
    if node.relieves != NO_ROUTE:
        return f"relieves {node.relieves}"
    return "" if coming is None else f"{coming} relieves it"


def _doing(node: NodeStatus, others: int) -> str:
    """`others`: how many nodes have a route that leads through it, or to it."""
    condition = condition_of(node)
    if condition in (Condition.OFF, Condition.SILENT, Condition.CRASHED):
        return ""
    if node.repair:
        return node.repair
    if len(node.path):
        corners = waypoints(node.path)
        if not position_is_known(node) or tuple(corners[-1]) == tuple(node.position):
            return "flies"
        end, here = Location.from_vector(corners[-1]), Location.from_vector(node.position)
        place = f"x {end.longitude:.1f}, y {end.latitude:.1f}"
        return f"flies to {place}: {here.distance_m(end):.0f} m left"
    if node.mission or node.pad:
        return node.mission or node.pad
    if len(node.heading):
        return "flies with its pilot"
    if condition is not Condition.CONNECTED:
        return "looks for a gateway"
    routers = "1 router" if others == 1 else f"{others} routers"
    if node.role == Role.GATEWAY and len(node.route) < 2:  # with no internet it is a relay
        return f"serves {routers}"
    return f"relays for {routers}" if others else "relays for nobody"
