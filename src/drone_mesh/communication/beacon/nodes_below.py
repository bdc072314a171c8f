"""NodesBelow: the nodes that a node leads to, and which of them its next beacon names."""

from __future__ import annotations

import math

from drone_mesh.communication.beacon.packets import NOT_LISTED, Beacon, Below, ids_that_fit
from drone_mesh.communication.beacon.routes import BeaconRoutes

LINGERS = 1.0  # intervals: a node that has left is still announced for so long


class NodesBelow:
    """The nodes below one node, as its children announce them, and its own announcements."""

    def __init__(self, node_id: int, routes: BeaconRoutes) -> None:
        self._node_id, self._routes = node_id, routes
        self._known_s: dict[int, float] = {}  # and when they were below it last
        self._announced: set[int] = set()
        self._new: set[int] = set()  # since this node has announced it last
        self._announced_last = self._shown_last = 0

    def heard(self, node: int, beacon: Beacon) -> None:
        """A neighbour's beacon, of which the routes do not know yet."""
        if beacon.parent == self._node_id:
            known = self._routes.neighbours.get(node)
            if known is None or known.beacon.parent != self._node_id:
                self._new.add(node)
            self._new.update(beacon.below.new)

    def known_s(self, node: int) -> float:
        """When `node` was below this one last, or -infinity. Any thread."""
        return self._known_s.get(node, -math.inf)

    def ids(self) -> set[int]:
        """The nodes that this one leads to.

        A node that has left is mostly still near, and its new way is not known further up yet.
        """
        routes, known_s = self._routes, self._known_s
        now_s, period_s = routes.now_s, 0.0
        for child in routes.neighbours.values():
            period_s = max(period_s, child.beacon.interval_s)
            if child.beacon.parent == self._node_id:
                known_s[child.node] = now_s
                known_s.update(dict.fromkeys(child.announced_s, now_s))
        for node in (self._node_id, *routes.ancestors, routes.parent):
            known_s.pop(node, None)
        for node in [n for n, at_s in known_s.items() if now_s - at_s > LINGERS * period_s]:
            del known_s[node]
        return set(known_s)

    def to_announce(self, most: int) -> Below:
        """The next part of them, and those that came to it, in at most so many bytes."""
        below, after = self.ids(), self._announced_last
        if most < 1:
            return NOT_LISTED
        self._announced &= below
        self._new = self._new & below | below - self._announced
        turn = sorted(below, key=lambda node: (node - after - 1) % 256)
        new = sorted(self._new)[: max(0, most - 1)]
        listed = ids_that_fit(turn, most)
        if new and len(new) >= len(self._new.intersection(listed)):
            turn = [node for node in turn if node not in new]
            listed = ids_that_fit(turn, most - len(new))
        else:  # none, or many at once, such as a whole subtree
            new = []
        self._new.difference_update(new, listed)
        if listed:
            self._announced_last = listed[-1]
        if len(listed) == len(turn):
            after = self._announced_last  # once round
        self._announced.update(listed, new)
        return Below(after, listed, tuple(new))

    @property
    def has_news(self) -> bool:
        """Whether a node has come from elsewhere and is not announced yet."""
        return bool(self._new)

    def to_show(self, most: int) -> tuple[int, ...]:
        """The next part of the neighbours with whom the link will last, at most so many."""
        routes = self._routes
        lasting = [n for n, one in routes.neighbours.items() if one.usable and not routes.risk(one)]
        lasting.sort(key=lambda node: (node - self._shown_last - 1) % 256)
        if most < 1 or not lasting:
            return ()
        self._shown_last = lasting[:most][-1]
        return tuple(lasting[:most])
