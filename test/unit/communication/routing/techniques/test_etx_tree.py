"""EtxTree: the parent with the lowest path ETX, and no switching for little."""

from __future__ import annotations

import pytest
from routing_rig import hear, next_hop, present, started

from drone_mesh.communication.routing.techniques.etx_tree import SOLICITATION_TYPE, EtxTree
from drone_mesh.communication.wire.packet_types import MessageType

ROOT = "00 8000"  # gateway 0 itself: rank 128, little-endian
ONE_HOP = "00 0001"
THREE_HOPS = "00 0002"


@pytest.fixture
def tree():
    return started(EtxTree())


def test_the_lowest_sum_of_rank_and_link_wins(tree):
    hear(tree, present(5, THREE_HOPS))
    assert next_hop(tree) == 5
    hear(tree, present(6, ROOT))
    assert next_hop(tree) == 6


def test_a_parent_is_kept_for_a_gain_of_less_than_one_and_a_half_transmissions(tree):
    hear(tree, present(5, ONE_HOP))
    assert next_hop(tree) == 5
    hear(tree, present(6, ROOT))
    assert next_hop(tree) == 5


def test_a_link_that_loses_packets_costs_its_transmissions(tree):
    hear(tree, present(5, ROOT))
    assert next_hop(tree) == 5
    for _ in range(50):
        tree.sent(5, True, 4)
    hear(tree, present(6, ONE_HOP))
    assert next_hop(tree) == 6


def test_a_gateway_advertises_the_root_rank():
    gateway = started(EtxTree(), node_id=0)
    assert gateway.extension(MessageType.PRESENT, 25) == bytes.fromhex(ROOT)


def test_a_router_advertises_its_parent_plus_the_link(tree):
    hear(tree, present(5, ROOT))
    assert tree.extension(MessageType.PRESENT, 25) == bytes.fromhex(ONE_HOP)


def test_a_router_whose_gateway_does_not_answer_advertises_no_rank(tree):
    hear(tree, present(5, ROOT))
    tree.essentials.connected = False
    assert tree.extension(MessageType.PRESENT, 25) == b""


def test_heartbeats_and_routers_without_a_parent_carry_no_bytes(tree):
    assert tree.extension(MessageType.HEARTBEAT, 24) == b""
    assert tree.extension(MessageType.PRESENT, 25) == b""


def test_a_neighbour_without_an_advertisement_is_no_parent(tree):
    hear(tree, present(5, ROOT))
    hear(tree, present(5))
    assert next_hop(tree) is None


def test_the_last_parent_gone_is_followed_by_a_solicitation(tree):
    hear(tree, present(5, ROOT))
    tree.cant_communicate_with_node(5)
    assert next_hop(tree) is None
    assert tree.essentials.broadcasts == [(SOLICITATION_TYPE, b"")]


def test_a_solicitation_is_answered_only_by_a_node_with_another_parent(tree):
    hear(tree, present(5, ROOT))
    tree.on_packet(5, 5, SOLICITATION_TYPE, bytes(27))
    assert tree.essentials.wake_s is None
    tree.on_packet(7, 7, SOLICITATION_TYPE, bytes(27))
    assert tree.essentials.wake_s == pytest.approx(0.2)


def test_a_route_back_is_the_one_a_heartbeat_came_by(tree):
    hear(tree, present(5, ROOT))
    heartbeat = bytes((9, 7, 4, 1, 0, 1, 0, 1)).ljust(32, b"\0")  # of 9, by way of 7
    hear(tree, heartbeat)
    assert next_hop(tree, 9) == 7
