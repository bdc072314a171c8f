"""The state of a mesh as a scene, in which nodes at one position are fanned out."""

from __future__ import annotations

import math

import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.state.model import MeshStatus, NodeStatus
from drone_mesh.view.scene import COINCIDENT_M, fan_offset, fan_out, fanned_positions, scene_of


def test_a_scene_shows_drones_of_known_position_with_conditions_links_and_paths():
    mesh = MeshStatus(
        3.0,
        [
            NodeStatus(0, Role.GATEWAY, connected=True, position=(0.0, 0.0, 0.0)),
            NodeStatus(1, connected=True, next_hop=0, neighbours=b"\x00\x02",
                       position=(1.0, 0.0, 0.0), route=b"\x01\x00"),
            NodeStatus(2, position=(2.0, 0.0, 1.0), path=(2.0, 0.0, 2.0, 5.0, 0.0, 0.0)),
            NodeStatus(3, on=False, position=(3.0, 0.0, 0.0)),
            NodeStatus(4, report_age=99.0, position=(4.0, 0.0, 0.0)),
            NodeStatus(5),
        ],
    )  # fmt: skip
    scene = scene_of(mesh)
    assert {drone.node_id: drone.condition for drone in scene.drones} == {
        0: Condition.CONNECTED,
        1: Condition.CONNECTED,
        2: Condition.FLYING,
        3: Condition.OFF,
        4: Condition.SILENT,
    }
    assert list(scene.drones[2].path) == [(2.0, 0.0, 2.0), (5.0, 0.0, 0.0)]
    assert {(link.start, link.end): link.use for link in scene.links} == {
        (0, 1): LinkUse.ROUTE,
        (1, 2): LinkUse.KNOWN,
    }
    assert scene.title.startswith("3.0 s: 1 of 3 routers connected, 1 switched off, 1 silent")


def test_drones_at_one_position_stand_side_by_side():
    nodes = [NodeStatus(node, position=(4.0, 4.0, 0.0)) for node in (1, 2, 3)]
    drones = scene_of(MeshStatus(3.0, nodes)).drones
    centres = [drone.centre(scale=2.0) for drone in drones]
    gaps = [math.dist(a, b) for i, a in enumerate(centres) for b in centres[:i]]
    assert min(gaps) > 2.0 * 0.2 * math.sqrt(2)


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
