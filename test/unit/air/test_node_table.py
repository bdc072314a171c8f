"""The rules of the simulated air (docs/ros.md, "Wireless signal simulator")."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from drone_mesh.air.node_table import AirError, Node, NodeTable
from drone_mesh.air.obstacles import Box, Obstacles

NOWHERE = (0.0, 0.0, 0.0)  # what an antenna gives as its position


def register_of(*places, max_distance_m=9.0):
    """Nodes 0, 1, ... at these places, as antenna and engine announce them."""
    table = NodeTable(max_distance_m)
    for node_id, place in enumerate(places):
        table.drone_info(node_id, place, "", True)
        table.drone_info(node_id, NOWHERE, f"/Node/{node_id}", True)
    return table


PLACE, ELSEWHERE = (1.0, 2.0, 0.05), (6.0, 7.0, 8.0)
TOPIC = "/Node/7"
KNOWN = [(PLACE, "", True), (NOWHERE, TOPIC, True)]
OFF = (NOWHERE, "", False)


@pytest.mark.parametrize(
    ("infos", "node", "position"),
    [
        pytest.param([(PLACE, TOPIC, True)], (TOPIC, True), PLACE, id="a stranger is there"),
        pytest.param([(PLACE, "", True)], None, PLACE, id="without sub only its place is kept"),
        pytest.param(
            [(PLACE, "", True), (ELSEWHERE, TOPIC, True)], (TOPIC, True), PLACE, id="then it counts"
        ),
        pytest.param([OFF], None, None, id="the power of an unknown node is no position"),
        pytest.param(
            [*KNOWN, (ELSEWHERE, TOPIC, True)], (TOPIC, True), PLACE, id="an antenna moves no node"
        ),
        pytest.param(
            [*KNOWN, (NOWHERE, TOPIC, False), (ELSEWHERE, "", True)],
            (TOPIC, False),
            ELSEWHERE,
            id="a flying drone does not switch its antenna back on",
        ),
        pytest.param([*KNOWN, OFF], (TOPIC, False), PLACE, id="the power alone moves nothing"),
        pytest.param([*KNOWN, OFF, OFF], (TOPIC, False), PLACE, id="nor twice"),
        # As in the original design; `on` is false then, because nobody has set it.
        pytest.param(
            [*KNOWN, (ELSEWHERE, "", False)],
            (TOPIC, True),
            ELSEWHERE,
            id="an engine that fills only id and position leaves it on",
        ),
        pytest.param(
            [*KNOWN, OFF, (NOWHERE, "", True)], (TOPIC, True), PLACE, id="the origin switches it on"
        ),
        pytest.param(
            [*KNOWN, (NOWHERE, "", True)],
            (TOPIC, True),
            NOWHERE,
            id="the origin is a position for a node that is on",
        ),
        pytest.param(
            [*KNOWN, (NOWHERE, "/new", True)],
            ("/new", True),
            PLACE,
            id="a new sub counts",
        ),
    ],
)
def test_what_a_drone_info_changes(infos, node, position):
    table = NodeTable()
    for place, sub, on in infos:
        table.drone_info(7, place, sub, on)
    assert table.node(7) == (node and Node(7, *node))
    assert table.position(7) == position


def test_an_engine_moves_its_node():
    table = register_of((0.0, 0.0, 0.05), (5.0, 0.0, 0.05))
    assert table.in_range(0) == (1,)
    table.drone_info(1, (20.0, 0.0, 0.05), "", True)
    assert table.in_range(0) == ()
    assert table.link(0, 1) is None


@pytest.mark.parametrize(
    ("distance_m", "heard"), [(8.999, True), (9.0, False), (9.001, False), (0.0, True)]
)
def test_in_range_means_nearer_than_the_maximum(distance_m, heard):
    table = register_of((1.0, 1.0, 1.0), (1.0, 1.0, 1.0 + distance_m))
    assert (table.link(0, 1) == "/Node/1") is heard
    assert (table.in_range(0) == (1,)) is heard


def test_the_distance_is_euclidean_in_three_dimensions():
    assert register_of((0, 0, 0.1), (3, 4, 0.1), max_distance_m=5.01).in_range(0) == (1,)
    assert register_of((0, 0, 0.1), (3, 4, 1.0), max_distance_m=5.01).in_range(0) == ()


@pytest.mark.parametrize("off", [0, 1])
def test_a_node_that_is_off_neither_sends_nor_receives(off):
    table = register_of((0.0, 0.0, 0.05), (5.0, 0.0, 0.05))
    table.drone_info(off, NOWHERE, f"/Node/{off}", False)
    assert table.link(0, 1) is None
    assert table.in_range(0) == ()


def test_unknown_nodes_are_not_linked_and_cannot_request_the_nodes_in_range():
    table = register_of((0.0, 0.0, 0.05))
    assert table.link(0, 9) is None
    assert table.link(9, 0) is None
    with pytest.raises(AirError, match="node 9 is not registered"):
        table.in_range(9)


@pytest.mark.parametrize(
    ("node_id", "position", "sub", "why"),
    [
        (254, (1.0, 1.0, 1.0), "/Node/254", "invalid node id 254: must be 0..253"),
        (255, (1.0, 1.0, 1.0), "", "invalid node id 255: must be 0..253"),
        (3, (math.nan, 1.0, 1.0), "", "expected three finite numbers"),
        (3, (1.0, math.inf, 1.0), "/Node/3", "expected three finite numbers"),
        (3, (1.0, 1.0), "", "expected three finite numbers"),
        (3, NOWHERE, "/", "invalid topic name '/'"),
        (3, NOWHERE, "a b", "invalid topic name"),
        (3, NOWHERE, "~private", "invalid topic name"),
        (3, NOWHERE, "/Node/3\n", "invalid topic name"),
        (3, NOWHERE, "/" + "x" * 300, "invalid topic name"),
    ],
)
def test_bad_information_is_refused_and_changes_nothing(node_id, position, sub, why):
    table = register_of((1.0, 1.0, 1.0))
    with pytest.raises(AirError, match=why):
        table.drone_info(node_id, position, sub, True)
    assert table.node(node_id) is None
    assert table.position(node_id) is None


@pytest.mark.parametrize("distance_m", [0.0, -1.0, math.nan])
def test_an_invalid_maximum_distance_is_refused(distance_m):
    with pytest.raises(AirError, match="must be above 0"):
        NodeTable(distance_m)


def test_both_queries_agree_however_nodes_are_moved_and_switched():
    rng = random.Random(4)
    table = register_of(*[(rng.uniform(0, 30), rng.uniform(0, 30), 0.05) for _ in range(40)])
    for _ in range(200):
        node_id = rng.randrange(40)
        if rng.random() < 0.5:
            place = (rng.uniform(0, 30), rng.uniform(0, 30), rng.uniform(0, 9))
            table.drone_info(node_id, place, "", True)
        else:
            table.drone_info(node_id, NOWHERE, f"/Node/{node_id}", rng.random() < 0.7)
    links = {pair for pair in itertools.permutations(range(40), 2) if table.link(*pair)}
    assert links == {(a, b) for a in range(40) for b in table.in_range(a)}
    assert 100 < len(links) < 40 * 39


def test_a_wall_hides_nodes_from_each_other_until_one_flies_over_it():
    table = NodeTable(9.0, Obstacles([Box((2.5, 0.0, 1.0), (0.2, 20.0, 2.0))]))
    for node, x in ((1, 0.0), (2, 5.0), (3, 1.0)):
        table.drone_info(node, (x, 0.0, 0.05), "", True)
        table.drone_info(node, (0.0, 0.0, 0.0), f"/Node/{node}", True)
    assert table.in_range(1) == (3,)
    assert table.link(1, 2) is None
    assert table.link(2, 1) is None
    assert table.link(1, 1) == "/Node/1"  # an antenna's probe for its own registration
    table.drone_info(2, (5.0, 0.0, 6.0), "", True)
    assert table.in_range(1) == (2, 3)
    assert table.link(2, 1) == "/Node/1"
