"""The state of a mesh as a scene."""

from __future__ import annotations

import math

from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.state.model import MeshStatus, NodeStatus
from drone_mesh.view.scene import scene_of


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
