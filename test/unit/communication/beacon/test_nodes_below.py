"""NodesBelow: which nodes a node leads to, and how its beacons name them in turn."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.own_beacons import NodesBelow
from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    NOT_LISTED,
    Beacon,
    Below,
)
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.timing import Deadlines


class Node:
    """Node 9, as far as it hears the beacons of others."""

    def __init__(self) -> None:
        self.routes = BeaconRoutes(
            9, False, 10.0, lambda _node: None, shared=False, clock=Deadlines()
        )
        self.below = NodesBelow(9, self.routes)

    def hears(self, neighbour: int, beacon: Beacon) -> None:
        self.below.heard(neighbour, beacon)
        self.routes.heard(neighbour, beacon)


@pytest.fixture
def node() -> Node:
    return Node()


def beacon(hops: int, parent: int, below: Below = NONE_BELOW) -> Beacon:
    return Beacon(0, 5, hops, parent, NO_ANCESTORS, 1.0, below=below)


def test_children_and_what_they_announce_are_below(node):
    node.hears(1, beacon(hops=3, parent=9, below=Below(30, (20, 30))))
    node.hears(2, beacon(hops=3, parent=8, below=Below(40, (40,))))
    assert node.below.ids() == {1, 20, 30}


def test_a_node_that_its_child_lists_no_longer_is_soon_not_below(node):
    node.hears(1, beacon(hops=3, parent=9, below=Below(30, (20, 30))))
    node.below.ids()
    node.hears(1, beacon(hops=3, parent=9, below=Below(30, (30,))))
    node.routes.clock.now_s = 0.9
    assert node.below.ids() == {1, 20, 30}
    node.routes.clock.now_s = 1.1
    assert 20 not in node.below.ids()


def test_a_beacon_without_room_says_so(node):
    node.hears(1, beacon(hops=3, parent=9))
    assert node.below.to_announce(0) == NOT_LISTED
    assert node.below.to_announce(4).new == (1,)


def test_announcements_go_round_and_new_nodes_do_not_wait(node):
    ids = tuple(range(20, 28))
    node.hears(1, beacon(hops=3, parent=9, below=Below(27, ids)))
    listed = set()
    for _ in range(6):
        part = node.below.to_announce(4)
        listed.update(part.listed, part.new)
    assert listed == {1, *ids}
    node.hears(1, beacon(hops=3, parent=9, below=Below(99, (*ids, 99))))
    assert 99 in node.below.to_announce(4).new


def test_a_whole_subtree_that_comes_at_once_is_announced_in_one_list(node):
    ids = tuple(range(20, 60))
    node.hears(20, beacon(hops=3, parent=9, below=Below(59, ids[1:])))
    assert node.below.to_announce(8) == Below(59, ids)
    assert not node.below.has_news


def test_a_child_that_returns_is_announced_as_new_once_more(node):
    node.hears(1, beacon(hops=3, parent=9))
    node.below.to_announce(4)
    assert not node.below.has_news
    node.hears(1, beacon(hops=3, parent=8))
    node.hears(1, beacon(hops=3, parent=9))
    assert node.below.has_news
    assert node.below.to_announce(4).new == (1,)
    assert node.below.to_announce(4).listed == (1,)


def test_neighbours_are_shown_in_turn(node):
    for neighbour in (3, 5, 7):
        node.hears(neighbour, beacon(hops=3, parent=8))
    assert [node.below.to_show(2) for _ in range(3)] == [(3, 5), (7, 3), (5, 7)]
    assert node.below.to_show(0) == ()
