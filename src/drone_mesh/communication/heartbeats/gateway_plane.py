"""GatewayHeartbeats: a gateway's control plane by heartbeats (docs/protocol.md, "Gateway")."""

from __future__ import annotations

from drone_mesh.communication.control.control_plane import ControlledNode
from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.control.router_states import RouterEvent, RouterStates
from drone_mesh.communication.heartbeats.connection import GatewayConnection
from drone_mesh.communication.heartbeats.router_plane import RouterHeartbeats
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType


class OwnGateway(GatewayConnection):
    """The connection of a gateway with internet: to itself. Nobody else has to answer."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.gateway, self.hops = self._node_id, 0

    def next_hop(self) -> int:
        """Itself."""
        return self._node_id


class GatewayHeartbeats(RouterHeartbeats):
    """Answers heartbeats. While its internet does not work, it is a router instead."""

    def __init__(self, node: ControlledNode, technique: IRoutingTechnique) -> None:
        super().__init__(node, technique, RouterStates())
        self._to_another = self._connection  # while its internet does not work
        self._own = self._connected_by(node, OwnGateway)
        self._connection = self._own

    @property
    def _has_internet(self) -> bool:
        return self._connection is self._own

    @property
    def hops(self) -> int:
        """Hops to the gateway that it uses; 0 to itself."""
        return super().hops if self._has_internet or self._states.connected else NO_ROUTE

    @property
    def connected(self) -> bool:
        """Whether it has internet, or reaches another gateway."""
        return self.hops != NO_ROUTE

    def on_internet(self, works: bool) -> None:
        """Be a gateway, or a router that says so to all who take it for one."""
        self._to_another.end(RouterEvent.ROUTE_LOST)
        self._connection = self._own if works else self._to_another
        self.introduce()

    @receives(MessageType.PRESENT)
    def on_present(self, payload: bytes, creator: int, _from: int) -> None:
        """A neighbour introduces itself."""
        if not self._has_internet:
            super().on_present(payload, creator, _from)
            return
        _hops, know_gateway = messages.present_body(payload)
        if not know_gateway:
            self._introduction.answer_search(creator)

    @receives(MessageType.HEARTBEAT)
    def on_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        """A heartbeat for this node."""
        _know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
        self._host.on_node_heard(creator, hops + 1)
        self._search.found(creator)
        if not self._has_internet and preferred_gateway != self._node_id:
            super().on_heartbeat(payload, creator, from_)
        elif creator != preferred_gateway:  # gateways do not answer each other
            self.send_heartbeat(creator)

    def _forward_and_learn(
        self, payload: bytes, creator: int, from_: int, kind: int, forward: int, now_s: float
    ) -> None:
        """Another gateway's answer to a router behind it proves nothing to a gateway."""
        if self._has_internet:
            self._forwarding.forward(payload, creator, from_, kind, forward, now_s)
        else:
            super()._forward_and_learn(payload, creator, from_, kind, forward, now_s)

    # Users' data for nodes that this gateway does not know --------------------------------------

    def seek(self, node: int) -> bool:  # noqa: D102
        if self.way_up(NO_ROUTE) != NO_ROUTE:
            return False
        self._search.seek(node)
        return True
