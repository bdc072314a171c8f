"""The state of an in-process network, in the form used by all views."""

from __future__ import annotations

from typing import Iterable, Mapping

from drone_mesh.communication.events.observer import MeshEvent
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess.node import InProcessNode
from drone_mesh.state.links import route_to_gateway
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.state.observation import EventBatcher, describe_component, path_ahead


def mesh_status(
    nodes: Mapping[int, InProcessNode], now_s: float, max_distance_m: float
) -> MeshStatus:
    """The content of /mesh/state for these nodes now; it does not change afterwards."""
    known = {node_id: _node_status(node_id, nodes[node_id], now_s) for node_id in sorted(nodes)}
    for status in known.values():
        status.route = route_to_gateway(status.id, known)
    return MeshStatus(now_s, list(known.values()), max_distance_m)


def event_records(events: Iterable[MeshEvent]) -> list[EventRecord]:
    """The content of /mesh/events for these events, oldest first."""
    batcher = EventBatcher()
    records: list[EventRecord] = []
    for event in events:
        batcher.observe(event)
        records += batcher.drain()
    return records


def _node_status(node_id: int, node: InProcessNode, now_s: float) -> NodeStatus:
    status = NodeStatus(node_id, Role.GATEWAY if node.is_gateway else Role.ROUTER)
    describe_component(status, node.component, node.antenna.on(), now_s)
    status.position = node.drone.get_location().to_vector()
    path = node.drone.path
    status.path = () if path is None else path_ahead(path, now_s)
    return status
