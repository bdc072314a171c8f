"""HeartbeatParts: the parts of a node whose control plane works by heartbeats."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.communication.control.parts import NodeParts
from drone_mesh.communication.heartbeats.delivery import Delivery
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

_HEARTBEAT = int(MessageType.HEARTBEAT)


@dataclass(frozen=True)
class HeartbeatParts(NodeParts):
    """The parts of one node, with its routing technique."""

    routing: IRoutingTechnique
    delivery: Delivery

    def heartbeat(self, to: int, forward: int, connected: bool, gateway: int) -> bytes:
        """A heartbeat of this node for `forward`, including the routing technique's extension."""
        me = self.node_id
        payload = messages.heartbeat(me, me, to, forward, connected, gateway)
        room = messages.EXTENSION_ROOM[_HEARTBEAT] - self.seals.reserved_bytes(_HEARTBEAT)
        extension = self.routing.extension(_HEARTBEAT, room)
        return messages.extended(payload, extension) if extension else payload
