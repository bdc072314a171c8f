"""GatewayHeartbeats: a gateway's control plane by heartbeats (docs/protocol.md, "Gateway")."""

from __future__ import annotations

from drone_mesh.communication import messages
from drone_mesh.communication.heartbeats.plane import HeartbeatPlane
from drone_mesh.communication.router_states import RouterEvent


class GatewayHeartbeats(HeartbeatPlane):
    """Answers heartbeats. Its own connection is constant: it is the gateway."""

    hops = 0

    @property
    def gateway(self) -> int:
        """Itself."""
        return self._parts.node_id

    def check(self, due_s: float) -> None:
        """Check neighbours and routes."""
        self._technique.maintain_routing()

    def next_hop(self) -> int:
        """Itself."""
        return self.gateway

    def may_use(self, gateway: int) -> bool:
        """Whether that is this node."""
        return gateway == self.gateway

    def end(self, event: RouterEvent) -> None:
        """Nothing changes: without an antenna it is still a gateway."""

    def give_up_routes(self) -> None:
        """It needs none."""

    def gateway_sent_place(self) -> None:
        """It knows its own place."""

    def receive_present(self, payload: bytes, creator: int, _from: int) -> None:
        """A neighbour introduces itself."""
        _hops, know_gateway = messages.present_body(payload)
        if not know_gateway:
            self._introduction.answer_search(creator)

    def receive_heartbeat(self, payload: bytes, creator: int, _from: int) -> None:
        """A heartbeat for this node."""
        _know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
        self._host.on_node_heard(creator, hops + 1)
        if creator != preferred_gateway:  # gateways do not answer each other
            self.send_heartbeat(creator)

    def _after_missing(self, missing: int) -> None:
        self._host.on_node_missing(missing)
