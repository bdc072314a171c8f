"""NodeParts: shared by the objects that make up one mesh component."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.communication import messages
from drone_mesh.communication.deadlines import Deadlines
from drone_mesh.communication.delivery import Delivery
from drone_mesh.communication.flight import Pilot
from drone_mesh.communication.interfaces import IMeshSeals, IWirelessCommunication
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.observer import Reporter
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.communication.places import KnownPlaces
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import MeshTiming

_HEARTBEAT = int(MessageType.HEARTBEAT)


@dataclass(frozen=True)
class NodeParts:
    """The parts of one node. All belong to the thread that runs its component."""

    node_id: int
    timing: MeshTiming
    deadlines: Deadlines
    report: Reporter
    routing: IRoutingTechnique
    neighbours: Neighbours
    delivery: Delivery
    places: KnownPlaces
    pilot: Pilot
    antenna: IWirelessCommunication
    seals: IMeshSeals

    def heartbeat(self, to: int, forward: int, connected: bool, gateway: int) -> bytes:
        """A heartbeat of this node for `forward`, including the routing technique's extension."""
        me = self.node_id
        payload = messages.heartbeat(me, me, to, forward, connected, gateway)
        room = messages.EXTENSION_ROOM[_HEARTBEAT] - self.seals.reserved_bytes(_HEARTBEAT)
        extension = self.routing.extension(_HEARTBEAT, room)
        return messages.extended(payload, extension) if extension else payload

    @property
    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self.deadlines.now_s
