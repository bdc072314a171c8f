"""Batman: the next hop is the neighbour whose originator messages arrive best."""

from __future__ import annotations

import pytest
from routing_rig import next_hop, started

from drone_mesh.communication.routing.techniques.batman import ORIGINATOR_TYPE, Batman


@pytest.fixture
def batman():
    return started(Batman())


def originator(sequence, quality, hops_left=50, gateway=0):
    header = bytes((gateway, *sequence.to_bytes(2, "little"), quality, hops_left))
    return header.ljust(27, b"\0")


def hear(batman, neighbour, body):
    batman.on_packet(neighbour, neighbour, ORIGINATOR_TYPE, body)


def test_the_best_quality_wins(batman):
    hear(batman, 5, originator(1, 200))
    hear(batman, 6, originator(1, 250))
    assert next_hop(batman) == 6


def test_a_neighbour_that_is_heard_more_often_wins(batman):
    for sequence in range(1, 6):
        hear(batman, 5, originator(sequence, 200))
    hear(batman, 6, originator(5, 250))
    assert next_hop(batman) == 5


def test_what_is_older_than_the_window_no_longer_counts(batman):
    hear(batman, 5, originator(1, 250))
    hear(batman, 6, originator(7, 10))
    assert next_hop(batman) == 6


def test_a_message_from_the_best_neighbour_is_repeated_once_with_the_hop_penalty(batman):
    hear(batman, 5, originator(1, 255))
    batman.essentials.time_s = batman.essentials.wake_s
    batman.on_time(batman.essentials.time_s)
    assert batman.essentials.broadcasts == [(ORIGINATOR_TYPE, bytes.fromhex("00 0100 f0 31"))]
    hear(batman, 5, originator(1, 255))
    batman.on_time(batman.essentials.time_s + 1.0)
    assert len(batman.essentials.broadcasts) == 1


def test_a_message_without_hops_left_is_not_repeated(batman):
    hear(batman, 5, originator(1, 255, hops_left=0))
    batman.on_time(1.0)
    assert batman.essentials.broadcasts == []


def test_a_gateway_originates_in_its_check_and_five_seconds_later():
    gateway = started(Batman(), node_id=0)
    gateway.maintain_routing()
    assert gateway.essentials.broadcasts == [(ORIGINATOR_TYPE, bytes.fromhex("00 0100 ff 32"))]
    assert gateway.essentials.wake_s == 5.0
    gateway.essentials.time_s = 5.0
    gateway.on_time(5.0)
    assert len(gateway.essentials.broadcasts) == 2


def test_a_gateway_ignores_its_own_messages():
    gateway = started(Batman(), node_id=0)
    hear(gateway, 5, originator(9, 255))
    assert next_hop(gateway, 0) is None
