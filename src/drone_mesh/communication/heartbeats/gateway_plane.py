"""GatewayHeartbeats: a gateway's control plane by heartbeats (docs/protocol.md, "Gateway")."""

from __future__ import annotations

from drone_mesh.communication.control.control_plane import ControlledNode
from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.control.router_states import RouterEvent, RouterStates
from drone_mesh.communication.heartbeats.connection import GatewayConnection
from drone_mesh.communication.heartbeats.plane import HeartbeatPlane
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType


class OwnGateway(GatewayConnection):
    """The connection of a gateway with internet: to itself. Nobody else has to answer."""

    connected = True

    def __post_init__(self) -> None:
        super().__post_init__()
        self.gateway, self.hops = self._node_id, 0

    def next_hop(self) -> int:
        return self._node_id

    def on_present(self, neighbour: int, hops: int, know_gateway: bool) -> bool:
        return not know_gateway

    def on_gateway_heartbeat(self, gateway: int, hops: int) -> bool:
        """Another gateway's answer, also to a router behind this one, proves nothing here."""
        return False


class GatewayHeartbeats(HeartbeatPlane):
    """Answers heartbeats. While its internet does not work, it is a router instead."""

    def __init__(self, node: ControlledNode, technique: IRoutingTechnique) -> None:
        super().__init__(node, technique, RouterStates())
        self._to_another = self._connection  # while its internet does not work
        self._connection = self._own = self._connected_by(node, OwnGateway)

    @property
    def hops(self) -> int:
        """Hops to the gateway that it uses; 0 to itself."""
        return self._connection.hops if self.connected else NO_ROUTE

    def on_internet(self, works: bool) -> None:
        """Be a gateway, or a router that says so to all who take it for one."""
        self._to_another.end(RouterEvent.ROUTE_LOST)
        self._connection = self._own if works else self._to_another
        self.introduce()

    @receives(MessageType.HEARTBEAT)
    def on_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        _know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
        self._host.on_node_heard(creator, hops + 1)
        self._search.found(creator)
        self._forwarding.found(creator, self._deadlines.now_s)
        if self._connection is not self._own and preferred_gateway != self._node_id:
            super().on_heartbeat(payload, creator, from_)
        elif creator != preferred_gateway:  # gateways do not answer each other
            self.send_heartbeat(creator)

    def seek(self, node: int) -> bool:
        """Search for a node that this gateway does not know, for users' data."""
        if self.way_up(NO_ROUTE) != NO_ROUTE:
            return False
        self._search.seek(node)
        return True
