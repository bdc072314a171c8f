"""Which neighbour a node names its backup, by the rule of PADRA and DCR, on hand-drawn graphs."""

from __future__ import annotations

import pytest

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.interfaces import NeighbourView
from drone_mesh.communication.repair.named_backup import backup_for
from drone_mesh.drone.location import Location

ME, RANGE_M = 1, 9.0
GATEWAY_SIDE = 0


class Drawn:
    """What node 1 knows: places of its neighbours, the links that they show, who needs it."""

    node_id, range_m, lost_next_hop = ME, RANGE_M, GATEWAY_SIDE

    def __init__(self, places, links=(), own_way=(GATEWAY_SIDE,)):
        self._places = {node: Location(y, x, 0.0) for node, (x, y) in places.items()}
        self._links, self._own_way = links, own_way

    def neighbours(self):
        return {node: NeighbourView(at, 0.0, 1) for node, at in self._places.items()}

    def own_place(self):
        return Location(0.0, 0.0, 0.0)

    def heard_by(self, node):
        ends = [link for link in self._links if node in link]
        return frozenset(other for link in ends for other in link if other != node)

    def has_own_way(self, node):
        return node in self._own_way


WEST = (-8.0, 0.0)


@pytest.mark.parametrize(
    ("why", "drawn", "named"),
    [
        ("no part is cut off", Drawn({0: WEST, 2: (-4, 4)}), NO_ROUTE),
        (
            "a way over two hops that does not lead through this node",
            Drawn({0: WEST, 2: (8, 0)}, [(2, 7)], own_way=(0, 7)),
            NO_ROUTE,
        ),
        ("the only one", Drawn({0: WEST, 2: (8, 0)}), 2),
        (
            "no cut vertex before less degree and a shorter way",
            Drawn({0: WEST, 2: (4, 0), 3: (6, 4), 4: (6, -4)}, [(2, 5), (3, 4)]),
            3,
        ),
        (
            "one that another can confirm the loss to, before one alone",
            Drawn({0: WEST, 2: (0, 8), 3: (7, -2), 4: (7, -5)}),
            3,
        ),
        (
            "the least degree before the shortest way",
            Drawn({0: WEST, 2: (3, 0), 3: (6, 0), 4: (-2, 6)}),
            3,
        ),
        ("the nearest of equals", Drawn({0: WEST, 2: (6, 0), 3: (5, 2)}), 3),
    ],
)
def test_the_backup_is_no_cut_vertex_then_of_least_degree_then_the_nearest(why, drawn, named):
    assert backup_for(drawn, NO_ROUTE) == named, why


def test_a_backup_stays_the_backup_while_another_is_only_nearer_or_of_less_degree():
    assert backup_for(Drawn({0: WEST, 2: (6, 0), 3: (5, 2)}), 2) == 2
    assert backup_for(Drawn({0: WEST, 2: (3, 0), 3: (6, 0), 4: (-2, 6)}), 2) == 2
