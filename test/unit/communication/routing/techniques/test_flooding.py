"""Flooding: the first copy counts, and goes to all neighbours but the one it came from."""

from __future__ import annotations

import pytest
from routing_rig import hear, next_hop, present, started

from drone_mesh.communication.routing.techniques.flooding import Flooding
from drone_mesh.communication.wire.packet_types import MessageType


@pytest.fixture
def flooding():
    flooding = started(Flooding())
    for neighbour in (5, 6, 7):
        hear(flooding, present(neighbour))
    return flooding


def order(via):
    return bytes((0, via, 6, 1, 9)).ljust(32, b"\1")


def heartbeat(via, sequence, hops):
    return bytes((0, via, 4, 1, 9, 1, 0, hops, sequence)).ljust(32, b"\0")


def test_the_second_copy_of_a_packet_is_dropped(flooding):
    assert hear(flooding, order(via=5))
    assert not hear(flooding, order(via=6))


def test_the_same_order_counts_again_half_a_second_later(flooding):
    assert hear(flooding, order(via=5))
    flooding.essentials.time_s = 0.5
    assert hear(flooding, order(via=6))


def test_heartbeats_are_told_apart_by_their_number_and_not_by_their_hops(flooding):
    assert hear(flooding, heartbeat(via=5, sequence=1, hops=2))
    assert not hear(flooding, heartbeat(via=6, sequence=1, hops=3))
    assert hear(flooding, heartbeat(via=6, sequence=2, hops=3))


def test_each_heartbeat_gets_a_number(flooding):
    assert flooding.extension(MessageType.HEARTBEAT, 24) == b"\1\0"
    assert flooding.extension(MessageType.HEARTBEAT, 24) == b"\2\0"
    assert flooding.extension(MessageType.PRESENT, 25) == b""


def test_a_packet_goes_to_all_neighbours_but_its_sender_and_its_creator(flooding):
    assert flooding.directions(9, came_from=5, creator=6) == (7,)


def test_a_neighbour_gets_its_packets_directly(flooding):
    assert flooding.directions(6, came_from=5, creator=0) == (6,)


def test_a_node_that_was_not_heard_lately_counts_as_out_of_reach(flooding):
    hear(flooding, heartbeat(via=5, sequence=1, hops=2))
    assert next_hop(flooding, 0) == 5
    flooding.essentials.time_s = 21.0
    assert next_hop(flooding, 0) is None


def test_the_memory_of_packets_is_bounded(flooding):
    for sequence in range(2000):
        hear(flooding, bytes((0, 5, 4, 1, 9, 1, 0, 1)) + sequence.to_bytes(2, "little") + bytes(22))
    assert len(flooding._seen_s) <= 512
