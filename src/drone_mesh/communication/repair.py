"""ConnectionRepair: what a router does when its connection is lost for too long.

It waits, negotiates with its neighbours and flies one step back (docs/protocol.md,
"Lost connection" and "Negotiation").
"""

from __future__ import annotations

import math

from drone_mesh.communication.connection import GatewayConnection
from drone_mesh.communication.deadlines import Due
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.messages import MovementNegotiationMessage, addressed
from drone_mesh.communication.negotiation import NO_BID, Negotiation
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.parts import NodeParts
from drone_mesh.communication.router_states import Repair, RouterEvent, RouterStates
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import Location
from drone_mesh.errors import GoalRefused

ROUNDING_S = 1e-6  # sums of periods are not exact
MAX_SCORE_M = 1e9  # our choice: beyond every place there is, and it fits a float32


class ConnectionRepair:
    """The repair of one router. It moves the `Repair` of the router's states."""

    def __init__(
        self, parts: NodeParts, states: RouterStates, connection: GatewayConnection
    ) -> None:
        self._parts = parts
        self._states = states
        self._connection = connection
        self._lost_since_s = math.inf  # valid from LOSS_NOTICED until the router is AT_REST
        self._negotiation = Negotiation(parts.timing.check_period_s)

    # Lost connection -------------------------------------------------------------------------

    def on_unconnected_check(self, due_s: float) -> None:
        """A check, due at `due_s`, finds the router unconnected and no answer under way.

        Time counts from check to check as they were due, so that a late check costs no period.
        """
        if self._states.repair is Repair.AT_REST:
            self._lost_since_s = due_s
            self._connection.end(RouterEvent.LOSS_NOTICED)
            self._connection.give_up_routes()
        elif self._states.repair is Repair.LOST:
            lost_after_s = self._parts.timing.connection_lost_after_s
            if due_s - self._lost_since_s >= lost_after_s - ROUNDING_S:
                self._emergency()

    def on_connected(self) -> None:
        """A gateway answers again."""
        self._end_negotiation()

    def on_antenna_off(self) -> None:
        """The antenna has no power."""
        self._connection.end(RouterEvent.ANTENNA_OFF)
        self._end_negotiation()

    def on_take_off(self) -> None:
        """A flight has started, by an order or by the repair itself."""
        self._connection.end(RouterEvent.TOOK_OFF)
        self._end_negotiation()
        self._parts.places.left_own_place(self._connection.gateway)

    def _emergency(self) -> None:
        self._parts.report(MeshEventKind.EMERGENCY)
        if self._parts.routing.empty():
            self._states.happened(RouterEvent.NO_NEIGHBOURS)
            self._fly_back()
        else:
            self._negotiate()

    def _fly_back(self) -> None:
        """One step back towards the gateway; without a known place the drone stays."""
        step = self._step_back()
        if step is None:
            return
        place, node = step
        self._parts.report(MeshEventKind.FLIGHT_DECIDED, node)
        self._parts.neighbours.forget_all()
        self._parts.routing.node_moved_location()
        self._parts.pilot.fly_to(place, step_back=True)
        self.on_take_off()

    def _step_back(self) -> tuple[Location, int] | None:
        """The place to fly back to, and whose it is: the last good one, else the gateway's."""
        places = self._parts.places
        for place, node in (
            (places.good, places.good_id),
            (places.gateway, self._connection.gateway),
        ):
            if place is not None and _may_be_flown_to(place):
                return place, node
        return None

    # Negotiation -----------------------------------------------------------------------------

    def on_bid(self, node: int, score: float) -> None:
        """A neighbour bids for the flight."""
        self._negotiation.heard(node, score, self._parts.now_s)
        if self._states.repair is Repair.LOST:
            self._negotiate()
        self._decide()

    def on_neighbour_lost(self) -> None:
        """A neighbour is out of reach: the negotiation does not wait for its bid."""
        if self._states.repair is Repair.NEGOTIATING:
            self._parts.deadlines.set(Due.DECIDE, self._parts.now_s)

    def on_decision_due(self) -> None:
        """Each neighbour has had its time to bid."""
        self._decide()

    def _negotiate(self) -> None:
        score, me, delivery = self._score(), self._parts.node_id, self._parts.delivery
        self._parts.report(MeshEventKind.NEGOTIATION_STARTED, detail=f"score {score:.2f}")
        bid = MovementNegotiationMessage(me, me, me, me, score).to_payload()
        # As the others will read it: two equal scores must be equal for both nodes.
        score_on_the_air = MovementNegotiationMessage.from_payload(bid).cost
        self._states.happened(RouterEvent.BID)
        self._negotiation.start(me, score_on_the_air, self._parts.now_s)
        self._parts.deadlines.set(Due.DECIDE, self._negotiation.due_s)
        for neighbour in sorted(self._parts.routing.get_set_of_children()):
            delivery.send_own(addressed(bid, neighbour))
        self._decide()

    def _score(self) -> float:
        """Distance to the gateway's place in metres (the score), or NO_BID."""
        own, step = self._parts.pilot.location(), self._step_back()
        gateway = self._parts.places.gateway
        if own is None or step is None or gateway is None:
            return NO_BID
        if step[1] in self._parts.routing.get_set_of_children():
            return NO_BID
        return min(own.distance_m(gateway), MAX_SCORE_M)

    def _decide(self) -> None:
        if self._states.repair is not Repair.NEGOTIATING:
            return
        neighbours = self._parts.routing.get_set_of_children()
        if not self._negotiation.is_decided(neighbours, self._parts.now_s):
            self._parts.deadlines.set(Due.DECIDE, self._negotiation.due_s)
            return
        winner = self._negotiation.winner()
        self._states.happened(RouterEvent.BIDS_COUNTED)
        self._end_negotiation()
        self._parts.report(MeshEventKind.NEGOTIATION_ENDED, NO_ROUTE if winner is None else winner)
        if winner == self._parts.node_id:
            self._fly_back()

    def _end_negotiation(self) -> None:
        self._negotiation.clear()
        self._parts.deadlines.set(Due.DECIDE, math.inf)


def _may_be_flown_to(place: Location) -> bool:
    """Whether a drone may go there: a LOCATION may hold any numbers."""
    try:
        check_goal(*place)
    except GoalRefused:
        return False
    return True
