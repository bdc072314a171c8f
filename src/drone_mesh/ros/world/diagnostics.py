"""The state of the mesh as diagnostics: one summary, and one status per node with a problem."""

from __future__ import annotations

from typing import Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.ros.graph.figures import HARDWARE_ID
from drone_mesh.state.condition import Trouble, find_trouble, summarise
from drone_mesh.state.model import MeshStatus, NodeStatus, channel_in_words, data_in_words


def diagnostics_msg(mesh: MeshStatus) -> DiagnosticArray:
    """One summary, and one entry for each node with a problem."""
    troubles = find_trouble(mesh.nodes)
    summary = summarise(mesh.nodes, troubles)
    by_id = {node.id: node for node in mesh.nodes}
    array = DiagnosticArray()
    array.header.stamp = ros_time(mesh.stamp_s)
    array.status.append(
        DiagnosticStatus(
            level=summary.severity,
            name="drone_mesh: mesh",
            message=summary.text,
            hardware_id=HARDWARE_ID,
            values=_values({"nodes": len(mesh.nodes), "with trouble": len(troubles)}),
        )
    )
    array.status += [_trouble_status(trouble, by_id[trouble.node]) for trouble in troubles]
    return array


def _trouble_status(trouble: Trouble, node: NodeStatus) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=trouble.severity,
        name=f"drone_mesh: node {trouble.node}",
        message=trouble.text,
        hardware_id=f"{HARDWARE_ID}_{trouble.node}",
        values=_values(
            {
                "on": node.on,
                "connected": node.connected,
                "hops": node.hops,
                "neighbours": _in_words(node.neighbours),
                "route": _in_words(node.route),
                "repair": node.repair,
                "radio channel": channel_in_words(node),
                "users' data": data_in_words(node),
            }
        ),
    )


def _in_words(ids: Sequence[int]) -> str:
    return " ".join(map(str, ids))


def _values(values: Mapping[str, object]) -> list[KeyValue]:
    return [KeyValue(key, str(value)) for key, value in values.items()]
