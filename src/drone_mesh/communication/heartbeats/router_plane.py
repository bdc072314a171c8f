"""RouterHeartbeats: a router's control plane by heartbeats (docs/protocol.md, "Connection")."""

from __future__ import annotations

from typing import Sequence

from drone_mesh.communication.control.control_plane import ControlledNode
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.control.router_states import (
    ConnectionState,
    RepairState,
    RouterEvent,
    RouterStates,
)
from drone_mesh.communication.heartbeats.connection import GatewayConnection
from drone_mesh.communication.heartbeats.plane import HeartbeatPlane
from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

_HEARTBEAT = int(MessageType.HEARTBEAT)
CHANGE_PERIODS = 0.3  # until the check after a neighbour was lost, on average


class RouterHeartbeats(HeartbeatPlane):
    """Keeps a connection to a gateway by heartbeats that it answers."""

    def __init__(
        self, node: ControlledNode, technique: IRoutingTechnique, states: RouterStates
    ) -> None:
        super().__init__(node, technique)
        self._host = node.host
        self._states = states
        self._may_be_gateway = node.seals.may_be_gateway
        self._rng = node.rng
        self._connection = self._connected_by(node, GatewayConnection)
        if self._medium.shared:
            self.forward = self._forward_and_learn

    def _connected_by(
        self, node: ControlledNode, kind: type[GatewayConnection]
    ) -> GatewayConnection:
        return kind(
            node.node_id,
            self._states,
            self._technique,
            self._delivery,
            self._heartbeats,
            self._introduction,
            PlaceRequests(node.node_id, node.pilot, node.antenna, self._delivery, node.deadlines),
            self._medium,
            node.deadlines,
            self._check_period_s,
            node.neighbours,
            node.places,
            node.report,
            node.seals.has_key,
        )

    @property
    def gateway(self) -> int:
        """The preferred gateway."""
        return self._connection.gateway

    @property
    def hops(self) -> int:
        """Hops to it."""
        return self._connection.hops

    @property
    def connected(self) -> bool:
        """Whether it answered the last heartbeat, or may still answer."""
        return self._states.connected

    @due(Due.ANSWER)
    def on_answer_missed(self) -> None:
        """The gateway did not answer in time."""
        self._connection.answer_missed()

    def check(self, due_s: float) -> None:
        """Check neighbours, routes and gateway."""
        if not self._host.may_connect(NO_ROUTE, False):
            return
        before = self._states.connection  # the routing may send a heartbeat to the gateway
        was_connected = self._states.connected
        self._technique.maintain_routing()
        if was_connected:
            self._connection.check(self._antenna.patience())
        elif self._connection.just_lost or before is not ConnectionState.SEARCHING:
            pass  # a repair counts from the next check, or a heartbeat is under way
        elif self._connection.asks_gateway_that_resigned():
            pass  # it is in reach: a flight would repair nothing
        elif self._states.repair is not RepairState.FLYING:
            self._host.on_unconnected_check(due_s)
        self._connection.just_lost = False

    def send_heartbeat(self, other: int) -> bool:
        """Send a heartbeat to `other`; the preferred gateway is expected to answer."""
        if other == self._connection.gateway:
            return self._connection.send_heartbeat()
        return super().send_heartbeat(other)

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """Send a heartbeat to each of these; the preferred gateway's is sent as if alone."""
        gateway = self._connection.gateway
        if gateway in others and not self._connection.proven(self._antenna.patience()):
            self._connection.send_heartbeat()
        super().send_heartbeats([other for other in others if other != gateway])

    # The connection --------------------------------------------------------------------------

    def next_hop(self) -> int:
        """The next hop to the preferred gateway, or NO_ROUTE."""
        return self._connection.next_hop()

    def told_of_gateway(self, gateway: int) -> bool:
        """Whether `gateway` is the preferred one. If there is none yet, it becomes that."""
        return self._connection.told_of_gateway(gateway)

    def end(self, event: RouterEvent) -> None:
        """Disconnect because of `event`."""
        self._connection.end(event)

    def give_up_routes(self) -> None:
        """Forget every route to the gateway and inform the neighbours."""
        if self._connection.gateway != NO_ROUTE:
            self._delivery.gateway_lost(self._connection.gateway)

    def gateway_sent_place(self) -> None:
        """The preferred gateway itself reported its place."""
        self._connection.gateway_sent_place()

    # Packets ---------------------------------------------------------------------------------

    @receives(MessageType.PRESENT)
    def on_present(self, payload: bytes, creator: int, _from: int) -> None:
        """A neighbour introduces itself."""
        hops, know_gateway = messages.present_body(payload)
        self._neighbours.set_hops(creator, hops)
        if know_gateway and hops == 0:
            self._neighbours.set_gateway(creator, creator)
        if not self._host.may_connect(creator, know_gateway):
            return
        if creator == self._connection.gateway and hops != 0:
            self._connection.gateway_resigned()
        if know_gateway and hops <= self._connection.hops:
            self._introduction.search_is_answered()
        if self._connection.on_present(creator, hops, know_gateway):
            if know_gateway:
                self.send_heartbeat(creator)
            else:
                self._introduction.answer_search(creator)

    @receives(MessageType.HEARTBEAT)
    def on_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        """A heartbeat for this node."""
        if creator == self._node_id:
            return  # its own heartbeat came back, which proves nothing
        know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
        if creator == from_ and know_gateway and preferred_gateway <= MAX_NODE_ID:
            self._neighbours.set_gateway(creator, preferred_gateway)
        if not self._host.may_connect(from_, know_gateway):
            return
        if creator == self._connection.gateway != preferred_gateway:
            self._connection.gateway_resigned()
        if creator == preferred_gateway:
            if creator == self._connection.gateway:
                self._connection.answered_itself()
            if self._connection.on_gateway_heartbeat(creator, hops + 1):
                self._host.on_connected()
        elif know_gateway != self._states.connected:
            if not know_gateway:
                self.send_heartbeat(creator)
            elif not self._states.awaiting:
                self._connection.take_gateway_of(from_, preferred_gateway)

    def _forward_and_learn(
        self, payload: bytes, creator: int, from_: int, kind: int, forward: int, now_s: float
    ) -> None:
        """A gateway's answer proves the connection of each relay as well."""
        if kind == _HEARTBEAT:
            know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
            proves = creator == preferred_gateway and self._host.may_connect(NO_ROUTE, know_gateway)
            proves = proves and self._may_be_gateway(creator)
            if proves and self._connection.on_gateway_heartbeat(creator, hops + 1):
                self._host.on_connected()
        self._forwarding.forward(payload, creator, from_, kind, forward, now_s)

    def _after_missing(self, missing: int, told: bool) -> None:
        self._connection.on_route_lost()
        self._host.on_node_missing(missing, told)

    def _check_soon(self) -> None:
        """Let the next check come sooner, because the surroundings of this node have changed."""
        if self._medium.shared and self._states.connected:
            share = CHANGE_PERIODS * (0.5 + self._rng.random())
            soon_s = self._deadlines.now_s + share * self._check_period_s
            self._deadlines.set(Due.CHECK, min(soon_s, self._deadlines.get(Due.CHECK)))

    def another_next_hop(self, node: int, but: int) -> int:
        if node != self.gateway:
            return NO_ROUTE
        return self._connection.another_next_hop(but)

    def on_neighbour_lost(self, node: int) -> None:
        self._check_soon()
        self._connection.on_route_lost()
        self._host.on_neighbour_lost(node)
