"""MeshnetworkRouter: keeps a connection to a gateway, and flies back if it is lost for too long.

docs/protocol.md, "Connection", and docs/repair.md. `router_states` has its states and transitions.
"""

from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING

from drone_mesh.communication.control.delivery import ITechnique
from drone_mesh.communication.control.place_requests import LastPlace
from drone_mesh.communication.control.router_states import RepairState, RouterStates
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.communication.node.mesh_node import NodeSettings
from drone_mesh.communication.repair.connection_repair import ConnectionRepair
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.status import RepairStatus
from drone_mesh.communication.repair.strategies.thesis import Thesis
from drone_mesh.communication.timing.deadlines import Due
from drone_mesh.communication.wire.messages import (
    GatewayPlace,
    MovementNegotiationMessage,
    is_goal,
    place_in,
)
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location

if TYPE_CHECKING:
    from typing_extensions import Unpack

GOAL_AGAIN_S = 0.15  # broadcasts are not acknowledged, and it is soon out of reach
SHORT_FLIGHT = 0.25  # of the range: the discs before and after share 84 % of their area


class MeshnetworkRouter(MeshnetworkComponent):
    """A node that forwards packets for others and is not a gateway."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: ITechnique,
        rng: random.Random,
        repair: IRepairStrategy | None = None,
        **settings: Unpack[NodeSettings],
    ) -> None:
        """Like MeshNode; the default of `repair` is Thesis."""
        self._states = states = RouterStates()
        super().__init__(node_id, antenna, engine, routing, rng, states, **settings)
        self._repair = ConnectionRepair(
            self._parts, states, self.control, repair or Thesis(), self._options
        )

    def tick(self, now_s: float) -> None:
        """Do what is due."""
        super().tick(now_s)
        if now_s >= self._deadlines.at_s[Due.GOAL]:
            self._deadlines.set(Due.GOAL, math.inf)
            goal = self._pilot.goal
            if goal is not None:
                self._repair.announce_place(goal)
        if now_s >= self._deadlines.at_s[Due.REPAIR] and self._repair.on_due():
            self._landed()

    def _check(self, due_s: float) -> None:
        super()._check(due_s)
        if self._states.connected:
            self.places.connected_here(self._pilot.place(), self.control.hops)

    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered the last heartbeat, or may still answer."""
        return self._states.connected

    def get_repair_status(self) -> RepairStatus:
        """What the node does about a lost connection, and why."""
        return self._repair.status()

    # For the control plane -------------------------------------------------------------------

    def may_connect(self, node: int, know_gateway: bool) -> bool:
        """See ConnectionRepair; also for the functions below."""
        if self._states.nothing_to_repair:  # it does not fly; most packets
            return True
        return self._repair.may_connect(node, know_gateway)

    def on_connected(self) -> None:  # noqa: D102
        self._own_id.connected_s = min(self._own_id.connected_s, self._deadlines.now_s)
        self.places.connected_here(self._pilot.place(), self.control.hops)
        self._repair.on_connected()

    def on_unconnected_check(self, due_s: float) -> None:  # noqa: D102
        self._repair.on_unconnected_check(due_s)

    def on_neighbour_lost(self, node: int) -> None:  # noqa: D102
        self._repair.on_neighbour_lost(node)

    # Packets ---------------------------------------------------------------------------------

    @property
    def _served(self) -> bool:
        connected_for_s = self._deadlines.now_s - self._own_id.connected_s
        return connected_for_s > self._timing.check_period_s

    def _antenna_is_off(self) -> None:
        self._repair.on_antenna_off()

    def _on_passing_location(self, creator: int, payload: bytes) -> None:
        """Relays use the gateway's place as well, unless only the addressee can check it."""
        if self._parts.has_key:
            return
        if creator == self.control.gateway:
            place = place_in(payload)
            if self._parts.may_be_at(place, gateway=True, says_so=not is_goal(payload)):
                self.places.update_gateway(place, self._deadlines.now_s)

    def receive_movement_negotiation(self, payload: bytes, creator: int, from_: int) -> None:
        """A neighbour bids for the flight, or announces one to the gateway's place."""
        if creator != self._node_id:
            bid = MovementNegotiationMessage.from_payload(payload)
            gateway = GatewayPlace.from_payload(payload)
            about = None if gateway is None else gateway.place
            self._repair.on_bid(creator, bid.cost, from_, about)

    def _on_location(
        self, node: int, location: Location, is_goal: bool, gateway: GatewayPlace | None
    ) -> None:
        now_s, control = self._deadlines.now_s, self.control
        is_gateway = node == control.gateway
        # A gateway is followed to its goal; a relay's goal is not where this node had a link to it.
        is_next_hop = node == control.next_hop() and (is_gateway or not is_goal)
        if is_gateway:
            control.gateway_sent_place()
        elif gateway is not None:
            self._on_gateway_place(gateway)
        judged = is_gateway or is_next_hop
        if judged and not self._parts.may_be_at(location, is_gateway, says_so=not is_goal):
            return
        self._neighbours.set_place(node, location, now_s, is_goal)
        if is_gateway:
            self.places.update_gateway(location, now_s)
        if is_next_hop:
            self.places.update_next_hop(node, location, now_s)
        self._repair.on_place(node, location)

    def _on_place_taken(self, place: Location) -> None:
        self._repair.on_taken(place)

    def _on_last_place(self, last: LastPlace) -> None:
        super()._on_last_place(last)
        heard = self._neighbours.place_of(last.node)
        if heard is not None:
            self._repair.on_taken(heard.place)
        self._repair.on_taken(last.place)

    def receive_gateway_place(self, payload: bytes, _creator: int, _from: int) -> None:
        """Where a gateway was, in a mesh with a key."""
        gateway = GatewayPlace.from_payload(payload)
        if gateway is not None:
            self._on_gateway_place(gateway)

    def _on_gateway_place(self, gateway: GatewayPlace) -> None:
        if not self.control.may_use(gateway.gateway):
            return
        if self._parts.may_be_at(gateway.place, gateway=True, says_so=False):
            seen_s = self._deadlines.now_s - gateway.age_s
            self.places.hear_of_gateway(gateway.place, seen_s, self._states.connected)

    def _on_neighbour_found(self, node: int) -> None:
        self._repair.on_neighbour_found(node)

    def _on_goal(self, neighbour: int, goal: Location) -> None:
        here = self._pilot.goal or self._pilot.location()
        if here is not None and here.distance_m(goal) >= self._repair.range_m:
            self.control.neighbour_leaves(neighbour)

    def _took_off(self) -> None:
        goal = self._pilot.goal
        if self._antenna.medium.shared and goal is not None:
            self._repair.announce_place(goal)
            self._deadlines.set(Due.GOAL, self._deadlines.now_s + GOAL_AGAIN_S)
            for neighbour in sorted(self._neighbours.ids()):
                heard = self._neighbours.place_of(neighbour)
                if heard is not None and heard.place.distance_m(goal) >= self._repair.range_m:
                    self.control.neighbour_leaves(neighbour)
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
            self.control.check(self._deadlines.now_s)
