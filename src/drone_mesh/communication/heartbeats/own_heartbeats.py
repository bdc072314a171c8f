"""OwnHeartbeats: the heartbeats that one node makes, with the extension of its technique."""

from __future__ import annotations

from drone_mesh.communication.interfaces import IMeshSeals
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

_HEARTBEAT = int(MessageType.HEARTBEAT)


class OwnHeartbeats:
    """Makes heartbeats."""

    def __init__(self, node_id: int, technique: IRoutingTechnique, seals: IMeshSeals) -> None:
        self._node_id = node_id
        self._technique = technique
        self._room = messages.EXTENSION_ROOM[_HEARTBEAT] - seals.reserved_bytes(_HEARTBEAT)

    def packet(self, to: int, forward: int, connected: bool, gateway: int) -> bytes:
        """A heartbeat of this node for `forward`."""
        me = self._node_id
        payload = messages.heartbeat(me, me, to, forward, connected, gateway)
        extension = self._technique.extension(_HEARTBEAT, self._room)
        return messages.extended(payload, extension) if extension else payload
