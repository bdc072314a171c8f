"""Links between nodes, and the use of each."""

from __future__ import annotations

import enum
import math
from typing import Iterable, Sequence, Tuple

import numpy as np

from drone_mesh.drone.roles import Role
from drone_mesh.state.model import NodeStatus, position_is_known

JUST_LOST_S = 6.0  # our choice: long enough to be noticed

Link = Tuple[int, int]  # the lower id first


class LinkUse(enum.Enum):
    """What a link is used for. The value is the text that views display."""

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
    # numpy, because a crowd of 254 lists 36,000 neighbours.
    on: np.ndarray = np.zeros(256, dtype=bool)  # an id is one byte
    on[[node.id for node in nodes if node.on]] = True
    listed: np.ndarray = np.zeros((on.size, on.size), dtype=bool)
    for node in nodes:
        listed[node.id, list(node.neighbours)] = True
    linked = np.triu((listed | listed.T) & on & on[:, None], k=1)
    return {(low, high) for low, high in np.argwhere(linked).tolist()}


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
