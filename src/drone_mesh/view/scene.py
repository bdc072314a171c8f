"""The state of a mesh as a picture of its world: for the world's window and for snapshots."""

from __future__ import annotations

from typing import Iterable

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.links import Link, known_links, shortest, way_links
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.roster import DroneView
from drone_mesh.state.trouble import SILENT_AFTER_S, find_trouble, summarise
from drone_mesh.view.picture import DroneCondition, DronePicture, LinkPicture, LinkUse, Scene

MOST_KNOWN_LINKS = 600  # our choice: more are one blot


def scene_of(mesh: MeshStatus, lost: Iterable[Link] = (), views: Iterable[DroneView] = ()) -> Scene:
    """All nodes whose place is known, and the links between them.

    `lost` are those just lost; `views` are newer than `mesh` as to where drones are.
    """
    newer = {view.id: view for view in views}
    shown = [node for node in mesh.nodes if position_is_known(node)]
    way = way_links(shown)
    links = {
        LinkUse.ROUTE: sorted(way),
        LinkUse.KNOWN: shortest(known_links(shown) - way, shown, MOST_KNOWN_LINKS),
        LinkUse.LOST: sorted(lost),
    }
    summary = summarise(mesh.nodes, find_trouble(mesh.nodes))
    return Scene(
        drones=[_drone(node, newer.get(node.id, node)) for node in shown],
        links=[LinkPicture(*link, use) for use, of_use in links.items() for link in of_use],
        title=f"{mesh.stamp_s:.1f} s: {summary.text}",
    )


def _drone(node: NodeStatus, seen: NodeStatus | DroneView) -> DronePicture:
    return DronePicture(
        node_id=node.id,
        role=Role(node.role),
        position=_vector(seen.position),
        condition=_condition(node),
        path=[_vector(seen.path[i : i + 3]) for i in range(0, len(seen.path), 3)],
    )


def _condition(node: NodeStatus) -> DroneCondition:
    if node.report_age >= SILENT_AFTER_S:
        return DroneCondition.UNKNOWN
    if not node.on:
        return DroneCondition.OFF
    return DroneCondition.CONNECTED if node.connected else DroneCondition.LOST


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = map(float, values)
    return (x, y, z)
