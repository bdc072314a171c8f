"""Searches: how often a node floods the mesh with the question where another one is."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.search import Searches

HOP_S = 0.0025
FOR_21 = b"\x15\x07\x00\x02"  # node 21, number 7, two hops left


@pytest.fixture
def routes():
    return BeaconRoutes(1, False, 9.0, lambda node: None)


@pytest.fixture
def sent():
    return []


@pytest.fixture
def searches(routes, sent):
    return Searches(1, routes, lambda kind, creator, body: sent.append((creator, body)), HOP_S)


def test_a_node_searches_for_one_after_the_other(routes, searches, sent):
    searches.search(21, 2)
    searches.search(22, 2)
    assert sent == [(1, b"\x15\x01\x00\x02")]

    routes.now_s = 400 * HOP_S
    searches.search(22, 2)
    assert sent[1:] == [(1, b"\x16\x02\x00\x02")]


def test_a_node_repeats_the_search_of_another_and_waits_before_its_own(routes, searches, sent):
    assert not searches.heard(3, 3, FOR_21)
    searches.search(22, 2)
    assert sent == [(3, b"\x15\x07\x00\x01")]

    routes.now_s = 400 * HOP_S
    searches.search(22, 2)
    assert sent[1:] == [(1, b"\x16\x01\x00\x02")]
