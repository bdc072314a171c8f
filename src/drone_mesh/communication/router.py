"""MeshnetworkRouter: keeps a connection to a gateway, and flies back when it is lost for too long.

Reference, section 9; SDD 3.2.4.
"""

from __future__ import annotations

import math
import random
from typing import NamedTuple, Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.component import MeshnetworkComponent
from drone_mesh.communication.deadlines import Due
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    IRoutingTechnique,
    IWirelessCommunication,
)
from drone_mesh.communication.messages import MessageType
from drone_mesh.communication.negotiation import NO_BID, Negotiation
from drone_mesh.communication.observer import MeshEventKind, MeshObserver, ignore_events
from drone_mesh.communication.timing import HEARTBEAT_ANSWER_S, MeshTiming
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine, Location
from drone_mesh.errors import GoalRefused

ROUNDING_S = 1e-6  # sums of periods are not exact
MAX_SCORE_M = 1e9  # our choice: beyond every place there is, and it fits a float32


class Shortcut(NamedTuple):
    """A neighbour that presented itself with fewer hops than the way in use."""

    neighbour: int
    hops: int


class MeshnetworkRouter(MeshnetworkComponent):
    """A node that forwards for others and is not itself a gateway."""

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
    ) -> None:
        """As MeshnetworkComponent."""
        super().__init__(node_id, antenna, engine, routing, rng, timing, observer, debug)
        # Between a heartbeat to the gateway and its answer; and the flag as noted for that moment.
        self._awaiting_answer = False
        self._was_connected = False
        self._heartbeat_sent_s = -math.inf
        self._answered_s = -math.inf
        self._shown_connected = False
        self._lost_since_s: float | None = None
        self._shortcut: Shortcut | None = None
        self._gateway_of: dict[int, int] = {}  # of neighbours, as their heartbeats say
        self._negotiation = Negotiation(self._timing.check_period_s)

    def tick(self, now_s: float) -> None:
        """Do what is due."""
        self._now_s = now_s
        if now_s >= self._deadlines.get(Due.ANSWER):
            self._stop_awaiting()
        super().tick(now_s)
        if now_s >= self._deadlines.get(Due.DECIDE):
            self._decide_negotiation()

    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered last time, or may still answer."""
        return self._knows_gateway()

    def send_heartbeat(self, other: int) -> bool:
        """A heartbeat towards `other`; the one to the preferred gateway wants an answer."""
        if other == self._preferred_gateway:
            return self._send_heartbeat_to_gateway()
        return super().send_heartbeat(other)

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """A heartbeat towards each of these; the one to the preferred gateway is as always."""
        if self._preferred_gateway in others:
            self._send_heartbeat_to_gateway()
        super().send_heartbeats([other for other in others if other != self._preferred_gateway])

    # The periodic check ----------------------------------------------------------------------

    def _begin(self) -> None:
        pass

    def _check(self, due_s: float) -> None:
        was_connected, was_waiting = self._knows_gateway(), self._awaiting_answer
        self._routing.maintain_routing()
        if was_connected:
            self._lost_since_s = None
            self._ask_for_locations()
            self._send_heartbeat_to_gateway()
        elif self._flight is None and not was_waiting:
            self._lost_connection(due_s)

    def _antenna_is_off(self) -> None:
        self._disconnect()
        self._lost_since_s = None
        self._end_negotiation()

    def _ask_for_locations(self) -> None:
        next_hop = self.get_route_to_gateway()
        if self._gateway_location is None or next_hop == self._preferred_gateway:
            self._delivery.send_own(MessageType.REQUESTLOCATION, self._preferred_gateway)
        if next_hop not in (self._preferred_gateway, NO_ROUTE):
            self._delivery.send_own(MessageType.REQUESTLOCATION, next_hop)

    # Connection ------------------------------------------------------------------------------

    def _knows_gateway(self) -> bool:
        return self._connected or (self._awaiting_answer and self._was_connected)

    def _send_heartbeat_to_gateway(self) -> bool:
        now_s = self._now_s
        if now_s - self._heartbeat_sent_s < HEARTBEAT_ANSWER_S:
            return True  # one is under way
        gateway = self._preferred_gateway
        body = self._heartbeat_body()
        self._was_connected = self._knows_gateway()
        self._awaiting_answer = True  # first: others may look in between
        self._connected = False
        self._deadlines.set(Due.ANSWER, now_s + HEARTBEAT_ANSWER_S)
        self._heartbeat_sent_s = now_s
        shortcut, self._shortcut = self._shortcut, None
        me = self._node_id
        if shortcut is not None and shortcut.hops + 1 < self._hops:
            # Fewer hops may be those to another gateway: then that one is asked as well, and its
            # answer decides. The neighbour might send this node's own heartbeat straight back.
            to = shortcut.neighbour
            its_gateway = self._gateway_of.get(to, gateway)
            packet = messages.packet(MessageType.HEARTBEAT, me, me, to, its_gateway, body)
            if self._delivery.send(packet, to) and its_gateway == gateway:
                return True
        if self._delivery.send_own(MessageType.HEARTBEAT, gateway, body):
            return True
        self._heartbeat_sent_s = -math.inf
        self._stop_awaiting()
        return False

    def _stop_awaiting(self) -> None:
        self._awaiting_answer = False
        self._deadlines.set(Due.ANSWER, math.inf)
        self._show_connection()

    def _show_connection(self) -> None:
        connected = self._knows_gateway()
        if connected != self._shown_connected:
            self._shown_connected = connected
            kind = MeshEventKind.CONNECTED if connected else MeshEventKind.DISCONNECTED
            detail = f"{self._hops} hops" if connected else ""
            self._report(kind, self._preferred_gateway, detail)

    def _disconnect(self) -> None:
        """Not connected, and hop counts of the past must not look good (reference 14.8)."""
        self._connected = False
        self._hops = NO_ROUTE
        self._shortcut = None
        self._heartbeat_sent_s = self._answered_s = -math.inf
        self._stop_awaiting()

    def _prefer(self, gateway: int) -> None:
        if gateway != self._preferred_gateway:
            if self._preferred_gateway != NO_ROUTE:
                self._report(MeshEventKind.GATEWAY_CHANGED, gateway)
            self._preferred_gateway = gateway
            self._gateway_location = None

    def _on_present(self, neighbour: int, hops: int, know_gateway: bool) -> None:
        knows = self._knows_gateway()
        if know_gateway != knows:
            if knows or not self._awaiting_answer:
                self.send_heartbeat(neighbour)
        elif (
            knows
            and hops + 1 < self._hops
            and (self._shortcut is None or hops < self._shortcut.hops)
            and self._routing.get_direction_to_node(neighbour) == neighbour
        ):
            self._shortcut = Shortcut(neighbour, hops)

    def _on_heartbeat(
        self, creator: int, from_: int, know_gateway: bool, preferred_gateway: int, hops: int
    ) -> None:
        if creator == self._node_id:
            return  # its own heartbeat came back: news of nobody
        if creator == from_ and know_gateway and preferred_gateway <= MAX_NODE_ID:
            self._gateway_of[creator] = preferred_gateway
        if creator == preferred_gateway:
            self._on_gateway_answer(creator, hops + 1)
        elif know_gateway != self._knows_gateway():
            if not know_gateway:
                self.send_heartbeat(creator)
            elif not self._awaiting_answer:
                self._take_gateway(preferred_gateway, from_)

    def _take_gateway(self, gateway: int, neighbour: int) -> None:
        """Try the gateway of a neighbour; other ways to it did not work."""
        if gateway > MAX_NODE_ID or gateway == self._node_id:
            return
        self._prefer(gateway)
        self._delivery.drop_routes_to(gateway)
        self._routing.other_can_communicate_with_node(neighbour, gateway)
        self._send_heartbeat_to_gateway()

    def _on_gateway_answer(self, gateway: int, hops: int) -> None:
        if gateway != self._preferred_gateway:
            recent = self._now_s - self._answered_s <= self._timing.check_period_s
            if (self._knows_gateway() or recent) and hops >= self._hops:
                return
            self._prefer(gateway)
        is_new = not self._knows_gateway()
        self._connected = True
        self._hops = min(hops, NO_ROUTE)
        self._answered_s = self._now_s
        self._lost_since_s = None
        self._stop_awaiting()
        if is_new:
            self._end_negotiation()
            self.search_other_nodes_in_range()
            self._ask_for_locations()

    # Lost connection -------------------------------------------------------------------------

    def _lost_connection(self, due_s: float) -> None:
        """Measured from check to check as they were due: a late one must not cost a period."""
        if self._lost_since_s is None:
            self._lost_since_s = due_s
            self._disconnect()
            if self._preferred_gateway != NO_ROUTE:
                self._delivery.drop_routes_to(self._preferred_gateway)
                self._delivery.tell_missing(self._preferred_gateway)
        elif self._negotiation.running:
            pass  # the emergency is being dealt with
        elif due_s - self._lost_since_s >= self._timing.connection_lost_after_s - ROUNDING_S:
            self._emergency()

    def _emergency(self) -> None:
        self._report(MeshEventKind.EMERGENCY)
        if self._routing.empty():
            self._lost_since_s = None
            self._fly_back()
        else:
            self._negotiate()

    def _fly_back(self) -> None:
        """One step back towards the gateway; who knows no place has nowhere to fly (14.7)."""
        step = self._step_back()
        if step is None:
            return
        place, at = step
        self._report(MeshEventKind.FLIGHT_DECIDED, at)
        self._forget_neighbourhood()
        self._fly_to(place)

    def _step_back(self) -> tuple[Location, int] | None:
        """The place to fly back to, and whose it is: the last good one, else the gateway's."""
        for place, node in (
            (self._good_location, self._good_location_id),
            (self._gateway_location, self._preferred_gateway),
        ):
            if place is not None and _may_be_flown_to(place):
                return place, node
        return None

    def _flight_started(self) -> None:
        self._disconnect()
        self._lost_since_s = None
        self._end_negotiation()
        self._set_good_location(self._preferred_gateway, self._gateway_location)

    def _landed(self) -> None:
        self._disconnect()
        super()._landed()

    # Negotiation -----------------------------------------------------------------------------

    def _negotiate(self) -> None:
        score = self._score()
        self._report(MeshEventKind.NEGOTIATION_STARTED, detail=f"score {score:.2f}")
        body = messages.MovementNegotiationMessage.BODY.pack(score)
        # As the others will read it: of equal scores nobody must look higher to everybody else.
        (score_on_the_air,) = messages.MovementNegotiationMessage.BODY.unpack(body)
        self._negotiation.start(self._node_id, score_on_the_air, self._now_s)
        self._deadlines.set(Due.DECIDE, self._negotiation.due_s)
        for neighbour in sorted(self._routing.get_set_of_children()):
            self._delivery.send_own(MessageType.MOVEMENT_NEGOTIATION, neighbour, body)
        self._decide_negotiation()

    def _score(self) -> float:
        """Distance to the gateway's place in metres (SDD formula 3.1), or NO_BID."""
        own, step = self._own_location(), self._step_back()
        if own is None or step is None or self._gateway_location is None:
            return NO_BID
        if step[1] in self._routing.get_set_of_children():
            return NO_BID
        return min(own.distance_m(self._gateway_location), MAX_SCORE_M)

    def _on_negotiation(self, bid: messages.MovementNegotiationMessage) -> None:
        self._negotiation.heard(bid.creator, bid.cost, self._now_s)
        if (
            self._lost_since_s is not None
            and not self._knows_gateway()
            and not self._negotiation.running
        ):
            self._negotiate()
        self._decide_negotiation()

    def _on_neighbour_lost(self, node: int) -> None:
        if self._negotiation.running:  # nobody waits for the bid of a node that is gone
            self._deadlines.set(Due.DECIDE, self._now_s)

    def _decide_negotiation(self) -> None:
        if not self._negotiation.running:
            return
        if not self._negotiation.is_decided(self._routing.get_set_of_children(), self._now_s):
            self._deadlines.set(Due.DECIDE, self._negotiation.due_s)
            return
        winner = self._negotiation.winner()
        self._end_negotiation()
        self._lost_since_s = None
        flies = NO_ROUTE if winner is None else winner
        self._report(MeshEventKind.NEGOTIATION_ENDED, flies)
        if winner == self._node_id:
            self._fly_back()

    def _end_negotiation(self) -> None:
        self._negotiation.clear()
        self._deadlines.set(Due.DECIDE, math.inf)


def _may_be_flown_to(place: Location) -> bool:
    """Anybody can say anything of where he is: not every place heard of is one for a drone."""
    try:
        check_goal(*place)
    except GoalRefused:
        return False
    return True
