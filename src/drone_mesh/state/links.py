"""Links between nodes, by what they are used for."""

from __future__ import annotations

import math
from typing import Sequence, Tuple

from drone_mesh.drone.roles import Role
from drone_mesh.state.model import NodeStatus, position_is_known

JUST_LOST_S = 6.0  # our choice: long enough to be seen

Link = Tuple[int, int]  # the lower id first


def known_links(nodes: Sequence[NodeStatus]) -> set[Link]:
    """Pairs of which one lists the other as a neighbour, and both are on."""
    on = {node.id for node in nodes if node.on}
    return {
        (min(node.id, other), max(node.id, other))
        for node in nodes
        if node.on
        for other in node.neighbours
        if other in on
    }


def way_links(nodes: Sequence[NodeStatus]) -> set[Link]:
    """The links that packets to a gateway take now."""
    on = {node.id for node in nodes if node.on}
    return {
        (min(node.id, node.next_hop), max(node.id, node.next_hop))
        for node in nodes
        if node.role == Role.ROUTER and node.on and node.connected and node.next_hop in on
    }


def shortest(links: set[Link], nodes: Sequence[NodeStatus], most: int) -> list[Link]:
    """At most so many of these links, the shortest ones: a crowd has too many to be seen."""
    places = {node.id: node.position for node in nodes if position_is_known(node)}
    drawable = [link for link in links if link[0] in places and link[1] in places]
    if len(drawable) <= most:
        return sorted(drawable)
    drawable.sort(key=lambda link: (math.dist(places[link[0]], places[link[1]]), link))
    return drawable[:most]


class LostLinks:
    """Remembers for a while which links there were. Belongs to one thread."""

    def __init__(self) -> None:
        self._links: set[Link] = set()
        self._lost_at_s: dict[Link, float] = {}

    def update(self, links: set[Link], wall_s: float) -> list[Link]:
        """The links now; returns those that were lost in the last JUST_LOST_S."""
        for link in self._links - links:
            self._lost_at_s[link] = wall_s
        self._lost_at_s = {
            link: at_s
            for link, at_s in self._lost_at_s.items()
            if link not in links and wall_s - at_s < JUST_LOST_S
        }
        self._links = set(links)
        return sorted(self._lost_at_s)
