"""Children of one node that list the same nodes: a move, or a liar."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.disputes import REMEMBERED_S
from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    Beacon,
    Below,
)
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.way_up import STALE
from drone_mesh.communication.timing import Deadlines

ME, LIAR, LEFT, RIGHT = 0, 1, 2, 3
NODES = {LEFT: (20, 21), RIGHT: (22, 23)}
ALL = (20, 21, 22, 23)
SETTLES_S = STALE  # with intervals of a second


class Mesh:
    """A gateway with two children that tell the truth, one second after the other."""

    def __init__(self):
        self.routes = BeaconRoutes(
            ME, True, 10.0, lambda _node: None, one_loss_counts=True, clock=Deadlines()
        )
        self.lists = {child: Below(nodes[0] - 1, nodes) for child, nodes in NODES.items()}

    def pass_s(self, seconds, **claims):
        """The liar sends each of its lists in turn, at the end of each second."""
        for _ in range(seconds):
            for child, below in self.lists.items():
                self.hear(child, below)
            self.routes.clock.now_s += 1.0
            for below in claims.get("claims", ()):
                self.hear(LIAR, below)

    def hear(self, child, below, **fields):
        self.routes.heard(
            child, Beacon(ME, 1, 1, ME, NO_ANCESTORS, 1.0, below=below)._replace(**fields)
        )

    def led(self):
        return {node: self.routes.get_direction_to_node(node) for node in ALL}


TRUTH = {20: LEFT, 21: LEFT, 22: RIGHT, 23: RIGHT}


@pytest.mark.parametrize(
    "claims",
    [[Below(19, ALL)], [Below(19, (), ALL)], [NONE_BELOW, Below(19, ALL)]],
    ids=["listed", "as new each time", "anew each time"],
)
@pytest.mark.parametrize("first_s", [0, 3], ids=["from the start", "later"])
def test_a_child_that_lists_the_nodes_of_all_others_leads_to_none_of_them(claims, first_s):
    mesh = Mesh()
    mesh.pass_s(first_s)
    mesh.pass_s(2 * int(SETTLES_S) + 2, claims=claims)
    assert mesh.led() == TRUTH


def test_a_child_that_lists_the_nodes_of_one_other_child_later_does_not_lead_to_them():
    mesh = Mesh()
    mesh.pass_s(3)
    mesh.pass_s(2 * int(SETTLES_S), claims=[NONE_BELOW, Below(19, NODES[LEFT])])
    assert mesh.led() == TRUTH


def test_a_liar_is_not_believed_again_after_a_pause():
    mesh = Mesh()
    mesh.pass_s(2 * int(SETTLES_S), claims=[Below(19, ALL)])
    mesh.pass_s(int(REMEMBERED_S / 2), claims=[NONE_BELOW])
    mesh.pass_s(1, claims=[Below(19, ALL)])
    assert mesh.led() == TRUTH


def test_nodes_that_move_to_another_child_are_reached_through_it_at_once_and_later():
    """Their old one lists them for a moment more."""
    mesh = Mesh()
    mesh.pass_s(3)
    mesh.hear(RIGHT, Below(21, (22, 23), (20,)))
    assert mesh.led()[20] == RIGHT
    mesh.lists[RIGHT] = Below(19, (20, 22, 23))
    mesh.pass_s(int(SETTLES_S))
    assert mesh.led()[20] == RIGHT
    mesh.lists[LEFT] = Below(19, (21,))
    mesh.pass_s(int(SETTLES_S))
    assert mesh.led() == {**TRUTH, 20: RIGHT}
    mesh.hear(LEFT, Below(19, (21,), (20,)))
    assert mesh.led()[20] == LEFT


def test_a_node_that_a_child_lists_is_looked_for_there_not_where_anybody_hears_it():
    mesh = Mesh()
    mesh.pass_s(1)
    mesh.hear(LIAR, NONE_BELOW, near=(*ALL, 30), parent=LEFT, hops=2)
    assert mesh.led() == TRUTH
    assert mesh.routes.get_direction_to_node(30) == LIAR
