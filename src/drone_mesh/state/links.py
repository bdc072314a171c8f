"""Routes and links between nodes, and the use of each link."""

from __future__ import annotations

import enum
import math
from typing import Iterable, Mapping, Sequence, Tuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import NodeStatus, position_is_known

JUST_LOST_S = 6.0  # long enough to be noticed

SOON_S = 5.0  # a forecast of more than that rarely holds
VELOCITY_OVER_S = 1.0  # simulated time over which a velocity is measured
SLOWEST_M_S = 0.02  # slower drones count as standing

Link = Tuple[int, int]  # the lower id first


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


class LinkUse(enum.Enum):
    """The use of a link. The value is the text that views display."""

    ROUTE = "route to a gateway"
    KNOWN = "known link"  # the two are neighbours, but no route uses the link
    LOST = "lost link"  # it existed a moment ago


def links_by_use(
    nodes: Sequence[NodeStatus], lost: Iterable[Link] = ()
) -> dict[LinkUse, set[Link]]:
    """Every link between these nodes, each with exactly one use. `lost` comes from LostLinks."""
    routes = route_links(nodes)
    return {
        LinkUse.ROUTE: routes,
        LinkUse.KNOWN: known_links(nodes) - routes,
        LinkUse.LOST: set(lost) - routes,
    }


def known_links(nodes: Sequence[NodeStatus]) -> set[Link]:
    """Pairs of nodes of which one lists the other as a neighbour while both are on."""
    present = [node for node in nodes if node.on]
    on = {node.id for node in present}
    return {
        (node.id, other) if node.id < other else (other, node.id)
        for node in present
        for other in on.intersection(node.neighbours)
        if other != node.id
    }


def route_links(nodes: Sequence[NodeStatus]) -> set[Link]:
    """The links that packets to a gateway use now."""
    on = {node.id for node in nodes if node.on}
    return {
        (min(node.id, node.next_hop), max(node.id, node.next_hop))
        for node in nodes
        if node.role == Role.ROUTER and node.on and node.connected and node.next_hop in on
    }


def shortest(links: set[Link], nodes: Sequence[NodeStatus], most: int) -> list[Link]:
    """At most `most` of these links, shortest first; a picture of a crowd has no room for more."""
    positions = {node.id: node.position for node in nodes if position_is_known(node)}
    drawable = [link for link in links if link[0] in positions and link[1] in positions]
    if len(drawable) <= most:
        return sorted(drawable)
    drawable.sort(key=lambda link: (math.dist(positions[link[0]], positions[link[1]]), link))
    return drawable[:most]


class LinkForecast:
    """Which links will soon break because their ends fly apart. Belongs to one thread."""

    def __init__(self) -> None:
        self._before: tuple[float, dict[int, Sequence[float]]] = (-math.inf, {})
        self._velocities: dict[int, Sequence[float]] = {}

    def update(
        self, links: Iterable[Link], nodes: Sequence[NodeStatus], now_s: float, range_m: float
    ) -> list[Link]:
        """The links among these that end within SOON_S if nobody changes course."""
        places: dict[int, Sequence[float]] = {
            node.id: tuple(node.position) for node in nodes if position_is_known(node)
        }
        before_s, before = self._before
        passed_s = now_s - before_s
        if not 0.0 <= passed_s < VELOCITY_OVER_S:
            is_fresh = 0.0 < passed_s < 5 * VELOCITY_OVER_S
            self._velocities = {
                node: [moved_m / passed_s for moved_m in _from(before[node], place)]
                for node, place in places.items()
                if is_fresh and node in before
            }
            self._before = now_s, places
        found = []
        for one, other in links:
            if {one, other} <= self._velocities.keys() & places.keys():
                away = _from(places[one], places[other])
                drift = _from(self._velocities[one], self._velocities[other])
                if link_expires_s(away, drift, range_m) < SOON_S:
                    found.append((one, other))
        return sorted(found)


def _from(one: Sequence[float], other: Sequence[float]) -> Sequence[float]:
    return [b - a for a, b in zip(one, other)]


def link_expires_s(away: Sequence[float], drift: Sequence[float], range_m: float) -> float:
    """Time until two nodes lose each other, given their relative place (m) and velocity (m/s).

    Su, Lee, Gerla: Mobility prediction and routing in ad hoc wireless networks, IJNM 2001. Infinity
    if they never do, 0 if they are out of range already.
    """
    speed2 = sum(v * v for v in drift)
    ahead = sum(a * v for a, v in zip(away, drift))
    room = range_m**2 - sum(a * a for a in away)
    if room <= 0.0:
        return 0.0
    if speed2 < SLOWEST_M_S**2:
        return math.inf
    return (-ahead + math.sqrt(ahead**2 + speed2 * room)) / speed2


class LostLinks:
    """Remembers recently lost links for a while. Belongs to one thread."""

    def __init__(self) -> None:
        self._links: set[Link] = set()
        self._lost_at_s: dict[Link, float] = {}

    def update(self, links: set[Link], wall_s: float) -> list[Link]:
        """Set the links that exist now; return those lost within the last JUST_LOST_S."""
        for link in self._links - links:
            self._lost_at_s[link] = wall_s
        self._lost_at_s = {
            link: at_s
            for link, at_s in self._lost_at_s.items()
            if link not in links and wall_s - at_s < JUST_LOST_S
        }
        self._links = set(links)
        return sorted(self._lost_at_s)
