"""Searches: how often a node floods the mesh with the question where another one is."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.verdicts import Searches
from drone_mesh.communication.timing import Deadlines

HOP_S = 0.0025
FOR_21 = b"\x15\x07\x00\x02"  # node 21, number 7, two hops left


@pytest.fixture
def routes():
    return BeaconRoutes(1, False, 9.0, lambda node: None, shared=True, clock=Deadlines())


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

    routes.clock.now_s = 400 * HOP_S
    searches.search(22, 2)
    assert sent[1:] == [(1, b"\x16\x02\x00\x02")]


def test_a_node_repeats_the_search_of_another_and_waits_before_its_own(routes, searches, sent):
    assert not searches.heard(3, 3, FOR_21)
    searches.search(22, 2)
    assert sent == [(3, b"\x15\x07\x00\x01")]

    routes.clock.now_s = 400 * HOP_S
    searches.search(22, 2)
    assert sent[1:] == [(1, b"\x16\x01\x00\x02")]


def test_on_a_fast_medium_the_same_node_is_searched_again_after_six_tenths_of_a_second(
    routes, sent
):
    searches = Searches(1, routes, lambda *_: sent.append(routes.now_s), 1e-5)
    for step in range(14):
        routes.clock.now_s = step / 8
        searches.search(21, 2)
    assert sent == [0.0, 0.625, 1.25]


def test_after_five_searches_in_vain_it_pauses_for_ten_seconds(routes, searches, sent):
    searched_s = []
    for second in range(40):
        routes.clock.now_s = 2.0 * second
        searches.search(21, 2)
        if len(sent) > len(searched_s):
            searched_s.append(routes.now_s)
    assert searched_s[:7] == [0.0, 2.0, 4.0, 6.0, 8.0, 18.0, 20.0]


@pytest.mark.parametrize(("after_s", "repeated"), [(4.0, 1), (6.0, 2)])
def test_a_search_that_comes_again_is_repeated_once_within_five_seconds(
    routes, searches, sent, after_s, repeated
):
    searches.heard(3, 3, FOR_21)
    routes.clock.now_s = after_s
    searches.heard(3, 4, FOR_21)
    assert len(sent) == repeated


def test_searches_that_found_the_node_do_not_count(routes, searches, sent):
    for second in range(0, 30, 3):
        routes.clock.now_s = float(second)
        searches.search(21, 2)
        searches.found(21)
    assert len(sent) == 10


@pytest.mark.parametrize(("hops_left", "repeated"), [(255, 11), (12, 11), (1, 0)])
def test_a_search_is_repeated_at_most_eleven_times_more(searches, sent, hops_left, repeated):
    searches.heard(3, 3, bytes((21, 7, 0, hops_left)))
    assert sent == [(3, bytes((21, 7, 0, repeated)))]
