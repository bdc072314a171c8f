"""Dsdv: the newest sequence number wins, and a broken route is announced."""

from __future__ import annotations

import pytest
from routing_rig import hear, next_hop, present, started

from drone_mesh.communication.routing.techniques.dsdv import Dsdv
from drone_mesh.communication.wire.packet_types import MessageType


@pytest.fixture
def vectors():
    return started(Dsdv())


def entry(sequence, hops, gateway=0):
    return bytes((gateway + 1, *sequence.to_bytes(2, "little"), hops)).hex()


def test_fewer_hops_win_among_equal_sequence_numbers(vectors):
    hear(vectors, present(5, entry(2, 3)))
    hear(vectors, present(6, entry(2, 1)))
    assert next_hop(vectors) == 6


def test_a_newer_sequence_number_wins_over_fewer_hops(vectors):
    hear(vectors, present(6, entry(2, 1)))
    hear(vectors, present(5, entry(4, 3)))
    assert next_hop(vectors) == 5


def test_sequence_numbers_wrap_round(vectors):
    hear(vectors, present(6, entry(0xFFFE, 1)))
    hear(vectors, present(5, entry(0, 1)))
    assert next_hop(vectors) == 5


def test_a_broken_route_gets_an_odd_number_and_infinite_hops(vectors):
    hear(vectors, present(6, entry(4, 1)))
    vectors.cant_communicate_with_node(6)
    assert next_hop(vectors) is None
    assert vectors.essentials.wake_s == pytest.approx(0.2)
    assert vectors.extension(MessageType.PRESENT, 25) == bytes.fromhex(entry(5, 255))


def test_a_broken_route_of_another_next_hop_changes_nothing(vectors):
    hear(vectors, present(6, entry(4, 1)))
    hear(vectors, present(5, entry(5, 255)))
    assert next_hop(vectors) == 6


def test_the_next_hop_that_lost_its_route_is_not_used(vectors):
    hear(vectors, present(6, entry(4, 1)))
    hear(vectors, present(6, entry(5, 255)))
    assert next_hop(vectors) is None


def test_a_gateway_makes_an_even_number_in_each_round():
    gateway = started(Dsdv(), node_id=0)
    for sequence in (2, 4):
        gateway.maintain_routing()
        assert gateway.extension(MessageType.PRESENT, 25) == bytes.fromhex(entry(sequence, 0))


def test_only_entries_that_fit_are_sent(vectors):
    for gateway in range(2, 12):
        hear(vectors, present(6, entry(2, 1, gateway)))
    assert len(vectors.extension(MessageType.PRESENT, 25)) == 24
