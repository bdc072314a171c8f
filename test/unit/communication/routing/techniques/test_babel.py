"""Babel: a route is used only if it is feasible; a starving node asks for a new number."""

from __future__ import annotations

import pytest
from routing_rig import hear, next_hop, present, started

from drone_mesh.communication.routing.techniques.babel import REQUEST_TYPE, Babel
from drone_mesh.communication.wire.packet_types import MessageType


@pytest.fixture
def babel():
    return started(Babel())


def update(sequence, metric, gateway=0):
    values = sequence.to_bytes(2, "little") + metric.to_bytes(2, "little")
    return (bytes((gateway + 1,)) + values).hex()


def test_the_smallest_metric_wins(babel):
    hear(babel, present(5, update(1, 512)))
    hear(babel, present(6, update(1, 256)))
    assert next_hop(babel) == 6


def test_a_router_advertises_its_next_hop_plus_the_link(babel):
    hear(babel, present(6, update(1, 256)))
    assert babel.extension(MessageType.PRESENT, 25) == bytes.fromhex(update(1, 512))


def test_a_neighbour_that_may_be_behind_this_node_is_not_feasible(babel):
    hear(babel, present(6, update(1, 0)))
    babel.extension(MessageType.PRESENT, 25)  # advertised: 256
    hear(babel, present(7, update(1, 512)))  # 7 probably learned it from here
    babel.cant_communicate_with_node(6)
    assert next_hop(babel) is None


def test_a_new_sequence_number_makes_it_feasible_again(babel):
    hear(babel, present(6, update(1, 0)))
    babel.extension(MessageType.PRESENT, 25)
    babel.cant_communicate_with_node(6)
    hear(babel, present(7, update(2, 512)))
    assert next_hop(babel) == 7


def test_a_starving_node_asks_for_the_next_sequence_number(babel):
    hear(babel, present(6, update(1, 0)))
    babel.extension(MessageType.PRESENT, 25)
    babel.cant_communicate_with_node(6)
    assert babel.essentials.broadcasts == [(REQUEST_TYPE, bytes.fromhex("00 0200 20"))]


def test_a_request_goes_on_along_the_route_with_one_hop_less(babel):
    hear(babel, present(6, update(1, 0)))
    babel.on_packet(9, 9, REQUEST_TYPE, bytes.fromhex("00 0200 20").ljust(27, b"\0"))
    assert babel.essentials.packets == [(REQUEST_TYPE, 6, bytes.fromhex("00 0200 1f"))]


def test_a_request_without_hops_left_ends(babel):
    hear(babel, present(6, update(1, 0)))
    babel.on_packet(9, 9, REQUEST_TYPE, bytes.fromhex("00 0200 00").ljust(27, b"\0"))
    assert babel.essentials.packets == []


def test_a_gateway_grants_the_number_that_is_asked_for():
    gateway = started(Babel(), node_id=0)
    gateway.on_packet(9, 9, REQUEST_TYPE, bytes.fromhex("00 0200 20").ljust(27, b"\0"))
    assert gateway.extension(MessageType.PRESENT, 25) == bytes.fromhex(update(2, 0))
    assert gateway.essentials.wake_s == pytest.approx(0.2)
