"""Turns the state of a mesh into a scene, for the world's window and for snapshots."""

from __future__ import annotations

from typing import Iterable

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import condition_of
from drone_mesh.state.links import Link, links_by_use, shortest
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.roster import DroneView
from drone_mesh.state.trouble import find_trouble, summarise
from drone_mesh.view.fan import Slot, fan_out
from drone_mesh.view.picture import DronePicture, LinkPicture, Scene, shape_named

MOST_LINKS = 600  # our choice, per use: more cannot be told apart


def scene_of(mesh: MeshStatus, lost: Iterable[Link] = (), views: Iterable[DroneView] = ()) -> Scene:
    """All nodes whose position is known, and the links between them.

    `lost` are the recently lost links; `views` have newer positions than `mesh`.
    """
    newer = {view.id: view for view in views}
    shown = [node for node in mesh.nodes if position_is_known(node)]
    slots = fan_out(shown)
    summary = summarise(mesh.nodes, find_trouble(mesh.nodes))
    return Scene(
        drones=[_drone(node, newer.get(node.id, node), slots.get(node.id)) for node in shown],
        links=[
            LinkPicture(*link, use)
            for use, links in links_by_use(shown, lost).items()
            for link in shortest(links, shown, MOST_LINKS)
        ],
        title=f"{mesh.stamp_s:.1f} s: {summary.text}",
        obstacles=mesh.obstacles,
        shape=shape_named(mesh.shape),
    )


def _drone(node: NodeStatus, seen: NodeStatus | DroneView, slot: Slot | None) -> DronePicture:
    return DronePicture(
        node_id=node.id,
        role=Role(node.role),
        position=_vector(seen.position),
        condition=condition_of(node),
        path=[_vector(seen.path[i : i + 3]) for i in range(0, len(seen.path), 3)],
        slot=slot,
    )


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = map(float, values)
    return (x, y, z)
