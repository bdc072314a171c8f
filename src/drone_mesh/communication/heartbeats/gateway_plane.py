"""GatewayHeartbeats: a gateway's control plane by heartbeats (docs/protocol.md, "Gateway")."""

from __future__ import annotations

from typing import Sequence

from drone_mesh.communication.control.control_plane import ControlledNode
from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.control.router_states import RouterEvent, RouterStates
from drone_mesh.communication.heartbeats.plane import HeartbeatPlane
from drone_mesh.communication.heartbeats.router_plane import RouterHeartbeats
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType


class GatewayHeartbeats(RouterHeartbeats):
    """Answers heartbeats. While its internet does not work, it is a router instead."""

    def __init__(self, node: ControlledNode, technique: IRoutingTechnique) -> None:
        super().__init__(node, technique, RouterStates())
        self._has_internet = True

    @property
    def gateway(self) -> int:
        """This gateway's own id; without internet, the other gateway that it uses."""
        return self._node_id if self._has_internet else super().gateway

    @property
    def hops(self) -> int:
        """Hops to that gateway; 0 for itself."""
        if self._has_internet:
            return 0
        return super().hops if self._states.connected else NO_ROUTE

    @property
    def connected(self) -> bool:
        """Whether it has internet, or reaches another gateway."""
        return self.hops != NO_ROUTE

    def on_internet(self, works: bool) -> None:
        """Be a gateway, or a router that says so to all who take it for one."""
        self._connection.end(RouterEvent.ROUTE_LOST)
        self._has_internet = works
        self.introduce()

    def check(self, due_s: float) -> None:
        """Check neighbours and routes."""
        if self._has_internet:
            self._technique.maintain_routing()
        else:
            super().check(due_s)

    def send_heartbeat(self, other: int) -> bool:
        """Send a heartbeat to `other`; a gateway with internet expects no answer."""
        if self._has_internet:
            return HeartbeatPlane.send_heartbeat(self, other)
        return super().send_heartbeat(other)

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """Send a heartbeat to each of these."""
        if self._has_internet:
            HeartbeatPlane.send_heartbeats(self, others)
        else:
            super().send_heartbeats(others)

    def next_hop(self) -> int:
        """Itself, or the next hop to another gateway."""
        return self.gateway if self._has_internet else super().next_hop()

    def told_of_gateway(self, gateway: int) -> bool:
        """Whether that is the preferred one."""
        return gateway == self.gateway if self._has_internet else super().told_of_gateway(gateway)

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

    def seek(self, node: int) -> bool:
        if self.way_up(NO_ROUTE) != NO_ROUTE:
            return False
        self._search.seek(node)
        return True
