"""What the beacons of a node say: its velocity, and in turn the nodes that it leads to."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drone_mesh.communication.beacon.own_beacons import NodesBelow, OwnBeacons, OwnMotion
from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    NOT_LISTED,
    Beacon,
    Below,
)
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.control.places import CommonFrame
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location


class Drone:
    place = Location(0.0, 0.0, 0.0)

    def locate(self):
        return self.place


@pytest.fixture
def drone():
    return Drone()


@pytest.fixture
def motion(drone):
    return OwnMotion(drone.locate, step_m=0.45)


def fly(drone, motion, seconds, east_m_s):
    for tick in range(int(seconds * 5)):
        drone.place = Location(0.0, east_m_s * tick / 5, 0.0)
        last = motion.at(tick / 5)
    return last


def test_the_velocity_is_that_of_the_last_two_seconds(drone, motion):
    assert fly(drone, motion, 6.0, 0.5).velocity == pytest.approx((0.0, 0.5, 0.0))


def test_a_place_that_jumps_at_the_start_is_no_great_velocity(drone, motion):
    motion.at(0.0)
    drone.place = Location(0.0, 1.0, 0.0)
    assert motion.at(0.1).velocity == pytest.approx((0.0, 1.0, 0.0))


def test_after_a_turn_the_velocity_is_that_of_the_new_leg(drone, motion):
    fly(drone, motion, 6.0, 0.5)
    for tick in range(30, 34):
        drone.place = Location(2.0 * (tick - 29) / 5, 2.9, 0.0)
        motion.at(tick / 5)
    motion.has_turned(6.6)
    drone.place = Location(2.0, 2.9, 0.0)
    assert motion.at(6.8).velocity == pytest.approx((2.0, 0.0, 0.0))


def test_soon_after_a_turn_a_receivers_noise_is_no_great_velocity(drone, motion):
    fly(drone, motion, 6.0, 0.0)
    motion.has_turned(6.5)
    motion.at(6.5)
    drone.place = Location(0.0, 0.2, 0.0)
    assert motion.at(6.7).velocity == pytest.approx((0.0, 0.4, 0.0))


def test_an_unknown_place_has_no_motion(drone, motion):
    drone.place = None
    assert motion.at(0.0) is None
    assert motion.stands(0.0)


def test_a_drone_that_is_flown_stands_again_ten_seconds_after_its_last_step(drone, motion):
    fly(drone, motion, 6.0, 0.5)
    assert not motion.stands(6.0)
    assert motion.stands(16.0)


def test_noise_of_a_receiver_is_no_flight(drone, motion):
    for tick in range(100):
        drone.place = Location(0.2 * (tick % 3 - 1), 0.2 * (tick % 2), 0.0)
        motion.at(tick / 5)
    assert motion.stands(20.0)


class Node:
    """Node 9, as far as it hears the beacons of others."""

    def __init__(self) -> None:
        self.routes = BeaconRoutes(
            9, False, 10.0, lambda _node: None, one_loss_counts=True, clock=Deadlines()
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


@pytest.mark.parametrize(("east_m_s", "with_place"), [(0.5, [1, 3, 5, 7]), (0.0, [1, 5])])
def test_beside_a_seal_long_lists_take_turns_with_a_place_that_is_told_less_often_at_rest(
    node, drone, motion, east_m_s, with_place
):
    seals = SimpleNamespace(reserved_bytes=lambda _kind: 7)
    own = OwnBeacons(seals, CommonFrame(0), node.routes, node.below, motion, 0.45)
    node.hears(1, beacon(hops=3, parent=9, below=Below(59, tuple(range(20, 60)))))
    told = []
    for second in range(1, 9):
        node.routes.clock.now_s = float(second)
        drone.place = Location(0.0, east_m_s * second, 0.0)
        node.routes.motion = motion.at(second)
        sent = Beacon.from_body(own.next_body(1.0), drone.place)
        assert sent is not None
        told += [second] if sent.motion else []
    assert told == with_place
