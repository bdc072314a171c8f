"""MeshnetworkRouter: keeps a connection to a gateway, and flies back if it is lost for too long.

docs/protocol.md, "Connection" to "Flight". Its states and transitions are in `router_states`.
"""

from __future__ import annotations

import math
import random
from typing import Sequence

from drone_mesh.communication.component import MeshnetworkComponent
from drone_mesh.communication.connection import GatewayConnection
from drone_mesh.communication.deadlines import Due
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    IWirelessCommunication,
)
from drone_mesh.communication.messages import (
    GatewayPlace,
    MovementNegotiationMessage,
    heartbeat_body,
    place_in,
    present_body,
)
from drone_mesh.communication.observer import MeshEventKind, MeshObserver, ignore_events
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.communication.repair.connection_repair import ConnectionRepair
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.status import NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.communication.repair.strategies.thesis import Thesis
from drone_mesh.communication.router_states import ConnectionState, RepairState, RouterStates
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location

GOAL_AGAIN_S = 0.15  # our choice: broadcasts are not acknowledged, and it is soon out of reach
SHORT_FLIGHT = 0.25  # of the range, our choice: the discs before and after share 84 % of their area


class MeshnetworkRouter(MeshnetworkComponent):
    """A node that forwards packets for others and is not a gateway."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: IRoutingTechnique,
        rng: random.Random,
        timing: MeshTiming | None = None,
        observer: MeshObserver = ignore_events,
        debug: bool = True,
        repair: IRepairStrategy | None = None,
        repair_options: RepairOptions | None = None,
    ) -> None:
        """Like MeshnetworkComponent; the default of `repair` is Thesis."""
        super().__init__(node_id, antenna, engine, routing, rng, timing, observer, debug)
        self._states = RouterStates()
        self._connection = GatewayConnection(
            self._parts, self._states, self.search_other_nodes_in_range
        )
        self._repair = ConnectionRepair(
            self._parts,
            self._states,
            self._connection,
            self.search_other_nodes_in_range,
            repair or Thesis(),
            repair_options or RepairOptions(),
        )
        self._repair_status = NOTHING_TO_REPAIR  # replaced whole: any thread reads it

    def tick(self, now_s: float) -> None:
        """Do what is due."""
        self._deadlines.now_s = now_s
        if now_s >= self._deadlines.get(Due.ANSWER):
            self._connection.answer_missed()
        super().tick(now_s)
        if now_s >= self._deadlines.get(Due.GOAL):
            self._deadlines.set(Due.GOAL, math.inf)
            goal = self._pilot.goal
            if goal is not None:
                self._repair.announce_place(goal)
        if now_s >= self._deadlines.get(Due.REPAIR) and self._repair.on_due():
            self._landed()
        self._repair_status = self._repair.status()

    def on_msg(self, payload: bytes, now_s: float) -> None:
        """Like MeshnetworkComponent."""
        self._receive(payload, now_s)
        if self._states.nothing_to_repair:  # most packets
            self._repair_status = NOTHING_TO_REPAIR
        else:
            self._repair_status = self._repair.status()

    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered the last heartbeat, or may still answer."""
        return self._states.connected

    def get_preferred_gateway(self) -> int:
        """Id of the gateway that this node uses, or NO_ROUTE while it knows none."""
        return self._connection.gateway

    def get_hops_from_gateway_away(self) -> int:
        """Hops to the preferred gateway; 255 while unknown."""
        return self._connection.hops

    def get_repair_status(self) -> RepairStatus:
        """What the node does about a lost connection, and why."""
        return self._repair_status

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

    def _check(self, due_s: float) -> None:
        if not self._repair.may_connect(NO_ROUTE, know_gateway=False):
            return
        before = self._states.connection  # the routing may send a heartbeat to the gateway
        was_connected = self._states.connected
        self._routing.maintain_routing()
        if was_connected:
            self._connection.check(self._antenna.patience())
        elif before is ConnectionState.SEARCHING and self._states.repair is not RepairState.FLYING:
            self._repair.on_unconnected_check(due_s)

    def _antenna_is_off(self) -> None:
        self._repair.on_antenna_off()

    def receive_present(self, payload: bytes, neighbour: int, _from: int) -> None:
        """A neighbour introduces itself."""
        hops, know_gateway = present_body(payload)
        self._neighbours.set_hops(neighbour, hops)
        if not self._repair.may_connect(neighbour, know_gateway):
            return
        if know_gateway and hops <= self._connection.hops:
            self._introduction.search_is_answered()
        if self._connection.on_present(neighbour, hops, know_gateway):
            if know_gateway:
                self.send_heartbeat(neighbour)
            else:
                self._introduction.answer_search(neighbour)

    def receive_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        """A gateway's answer, or the heartbeat of another node."""
        know_gateway, preferred_gateway, hops = heartbeat_body(payload)
        if creator == self._node_id:
            return  # its own heartbeat came back, which proves nothing
        if creator == from_ and know_gateway and preferred_gateway <= MAX_NODE_ID:
            self._neighbours.set_gateway(creator, preferred_gateway)
        if not self._repair.may_connect(from_, know_gateway):
            return
        if creator == preferred_gateway:
            if self._connection.on_gateway_heartbeat(creator, hops + 1):
                self._repair.on_connected()
        elif know_gateway != self._states.connected:
            if not know_gateway:
                self.send_heartbeat(creator)
            elif not self._states.awaiting:
                self._connection.take_gateway_of(from_, preferred_gateway)

    def _on_passing_heartbeat(
        self, creator: int, know_gateway: bool, preferred_gateway: int, hops: int
    ) -> None:
        """A gateway's answer proves the connection of each relay as well."""
        proves = creator == preferred_gateway and self._repair.may_connect(NO_ROUTE, know_gateway)
        proves = proves and self._parts.seals.may_be_gateway(creator)
        if proves and self._connection.on_gateway_heartbeat(creator, hops + 1):
            self._repair.on_connected()

    def _on_passing_location(self, creator: int, payload: bytes) -> None:
        """Relays use the gateway's place as well, unless only the addressee can check it."""
        if self._parts.seals.reserved_bytes(MessageType.LOCATION):
            return
        if creator == self._connection.gateway:
            self.places.update_gateway(place_in(payload), self._deadlines.now_s)

    def _on_negotiation(
        self, bid: MovementNegotiationMessage, gateway: GatewayPlace | None
    ) -> None:
        if bid.creator != self._node_id:
            about = None if gateway is None else gateway.place
            self._repair.on_bid(bid.creator, bid.cost, bid.from_, about)

    def _on_location(self, node: int, location: Location, gateway: GatewayPlace | None) -> None:
        now_s = self._deadlines.now_s
        self._neighbours.set_place(node, location, now_s)
        connection = self._connection
        if node == connection.gateway:
            self.places.update_gateway(location, now_s)
            connection.gateway_sent_place()
        elif gateway is not None:
            self._on_gateway_place(gateway)
        if node == connection.next_hop():
            self.places.update_next_hop(node, location, now_s)
        self._repair.on_place(node, location)

    def _on_missing(self, creator: int, missing: int, reported_by: int) -> None:
        super()._on_missing(creator, missing, reported_by)
        self._connection.on_route_lost()

    def _on_gateway_place(self, gateway: GatewayPlace) -> None:
        if self._connection.may_use(gateway.gateway):
            seen_s = self._deadlines.now_s - gateway.age_s
            self.places.update_gateway(gateway.place, seen_s)

    def _on_neighbour_found(self, node: int) -> None:
        self._repair.on_neighbour_found(node)

    def _on_neighbour_lost(self, node: int) -> None:
        self._connection.on_route_lost()
        self._repair.on_neighbour_lost(node)

    def _on_goal(self, neighbour: int, goal: Location) -> None:
        here = self._pilot.goal or self._pilot.location()
        if not self._antenna.medium.shared or here is None:
            return
        if here.distance_m(goal) >= self._repair.range_m:
            self._delivery.neighbour_leaves(neighbour)

    def _took_off(self) -> None:
        goal = self._pilot.goal
        if self._antenna.medium.shared and goal is not None:
            self._repair.announce_place(goal)
            self._deadlines.set(Due.GOAL, self._deadlines.now_s + GOAL_AGAIN_S)
            for neighbour in sorted(self._neighbours.ids()):
                heard = self._neighbours.place_of(neighbour)
                if heard is not None and heard.place.distance_m(goal) >= self._repair.range_m:
                    self._delivery.neighbour_leaves(neighbour)
        self._neighbours.takes_off(by_order=True)
        if not self._is_short_flight():
            self._repair.on_ordered_flight()

    def _is_short_flight(self) -> bool:
        """Whether most neighbours will remain in reach, so that the router remains a relay."""
        if not self._states.connected or self._states.repair is RepairState.FLYING:
            return False
        return self._pilot.distance_m() <= SHORT_FLIGHT * self._repair.range_m

    def _watch_flight(self) -> None:
        if not self._pilot.watch():
            self._repair.on_flight_second()
        elif self._repair.on_arrived():
            self._landed()

    def _landed(self) -> None:
        self._neighbours.stands(self._deadlines.now_s)
        if self._states.repair is RepairState.FLYING:
            self._repair.on_landed()
            super()._landed()
            return
        self._report(MeshEventKind.LANDED)
        self._orders.on_landed()
        if self._antenna.on():
            self._check(self._deadlines.now_s)
