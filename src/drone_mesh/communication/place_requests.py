"""Requests for places: a REQUESTLOCATION, which its addressee answers with a LOCATION."""

from __future__ import annotations

from drone_mesh.communication.interfaces import BROADCAST
from drone_mesh.communication.messages import packet
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.communication.parts import NodeParts


def ask_for_place(parts: NodeParts, node: int) -> None:
    """Ask `node` for its place, along the route to it."""
    me = parts.node_id
    parts.delivery.send_own(packet(MessageType.REQUESTLOCATION, me, me, node, node))


def ask_all_for_places(parts: NodeParts) -> None:
    """Ask every node in range for its place."""
    me = parts.node_id
    request = packet(MessageType.REQUESTLOCATION, me, me, BROADCAST, BROADCAST)
    parts.antenna.broadcast_message(request)
