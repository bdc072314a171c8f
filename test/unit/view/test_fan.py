"""Nodes at one position are fanned out."""

from __future__ import annotations

import math

import pytest

from drone_mesh.state.model import NodeStatus
from drone_mesh.view.scene import COINCIDENT_M, fan_offset, fan_out, fanned_positions


def at(*positions: tuple[float, float]) -> list[NodeStatus]:
    return [NodeStatus(node, position=(x, y, 0.0)) for node, (x, y) in enumerate(positions)]


def test_nodes_apart_have_no_slots():
    assert fan_out(at((0.0, 0.0), (1.0, 0.0), (0.0, COINCIDENT_M))) == {}


def test_nodes_at_one_position_get_a_slot_each_whatever_their_height():
    nodes = at((3.0, 3.0), (7.0, 7.0), (3.0, 3.0), (3.1, 3.0))
    nodes[2].position = (3.0, 3.0, 9.0)
    assert fan_out(nodes) == {0: (0, 3), 2: (1, 3), 3: (2, 3)}


def test_the_edge_of_a_cell_separates_no_drones():
    assert set(fan_out(at((-0.01, -0.01), (0.01, 0.01)))) == {0, 1}


def test_a_node_of_unknown_position_has_no_slot():
    assert fan_out([NodeStatus(1), NodeStatus(2)]) == {}


@pytest.mark.parametrize("size", [2, 3, 5, 17])
def test_the_discs_of_a_group_do_not_touch(size: int):
    centres = [fan_offset((number, size), radius=1.0) for number in range(size)]
    gaps = [math.dist(a, b) for i, a in enumerate(centres) for b in centres[:i]]
    assert min(gaps) > 2.0


def test_drones_at_one_position_are_drawn_apart_at_their_height_and_others_where_they_are():
    drawn = fanned_positions(at((3.0, 3.0), (3.0, 3.0), (3.0, 3.0), (9.0, 9.0)), radius_m=0.5)
    gaps = [math.dist(drawn[a], drawn[b]) for a, b in ((0, 1), (1, 2), (0, 2))]
    assert min(gaps) > 1.0
    assert {z for _x, _y, z in drawn.values()} == {0.0}
    assert drawn[3] == (9.0, 9.0, 0.0)
