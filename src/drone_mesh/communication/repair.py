"""ConnectionRepair: what a router does when its connection is lost for too long.

It waits, elects with its group the drone that flies, and flies one step back (docs/protocol.md,
"Lost connection" to "Flight").
"""

from __future__ import annotations

import math
from typing import Callable, NamedTuple

from drone_mesh.communication.connection import GatewayConnection
from drone_mesh.communication.deadlines import Due
from drone_mesh.communication.election import (
    IN_VAIN,
    MAX_SCORE_M,
    NO_BID,
    TOOK_OFF,
    TOOK_OFF_HOME,
    Election,
)
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.messages import MovementNegotiationMessage, addressed
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.parts import NodeParts
from drone_mesh.communication.repair_flight import ASK_AGAIN_S, RepairFlight, ask_all_for_places
from drone_mesh.communication.repair_options import RepairOptions
from drone_mesh.communication.router_states import Repair, RouterEvent, RouterStates
from drone_mesh.communication.spots import PITCH, beside, own_spot
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import Location
from drone_mesh.errors import GoalRefused

ROUNDING_S = 1e-6  # sums of periods are not exact
PLACES_WITHIN_S = 1.0  # docs/protocol.md, "Negotiation": how long to wait for places
SETTLE_S = 0.5  # our choice: a bid takes some milliseconds per hop; above what 50 hops need
TAKE_OFF_WITHIN_S = 5.0  # docs/protocol.md, "Negotiation": then the winner is passed over
SILENCE_FACTOR = 5.0  # our choice: how many times longer a node waits if its medium may be down
ROUNDS_WITHOUT_FLIER = 2  # docs/protocol.md, "Negotiation": then the second choice counts
HOME_AGAIN_S = 60.0  # docs/protocol.md, "Negotiation": between flights of a group to a gateway


class Step(NamedTuple):
    """A flight that a drone could make."""

    place: Location
    owner: int  # the node whose place it is
    home: bool  # whether it is the gateway's place


class ConnectionRepair:
    """The repair of one router. It moves the `Repair` of the router's states."""

    def __init__(
        self,
        parts: NodeParts,
        states: RouterStates,
        connection: GatewayConnection,
        introduce: Callable[[], None],
        options: RepairOptions,
    ) -> None:
        """`introduce` broadcasts a PRESENT."""
        self.reason = ""  # why it does not fly, in a few words
        self._parts = parts
        self._states = states
        self._connection = connection
        self._introduce = introduce
        self._options = options
        self._lost_since_s = math.inf  # valid from LOSS_NOTICED until the router is AT_REST
        self._checked_s: float | None = None  # the first check during an election was due then
        self._was_silent = False
        self._election = Election(parts.timing.check_period_s)
        self._asked_s = -math.inf
        self._bid = NO_BID
        self._winner = NO_ROUTE
        self._rounds_without_flier = 0
        self._quiet_until_s = -math.inf
        self._home_again_s = -math.inf  # not before this may another one fly to the gateway
        self._told_in_vain_s = -math.inf
        self._in_vain: list[Location] = []  # where this drone flew since it was last connected
        self._flight: RepairFlight | None = None

    # What the router reports -----------------------------------------------------------------

    def on_unconnected_check(self, due_s: float) -> None:
        """A check, due at `due_s`, finds the router unconnected and no answer under way.

        Time counts from check to check as they were due, so that a late check costs no period.
        """
        state = self._states.repair
        if state is Repair.AT_REST:
            self._notice_loss(due_s)
        elif state is Repair.LOST:
            self._was_silent = self._parts.neighbours.silent
            patience_s = self._parts.timing.connection_lost_after_s
            if self._was_silent:
                patience_s *= SILENCE_FACTOR
            if due_s - self._lost_since_s >= patience_s - ROUNDING_S:
                self._emergency()
        elif self._checked_s is None:
            self._checked_s = due_s

    def on_connected(self) -> None:
        """A gateway answers again."""
        self._end_election()
        self._rounds_without_flier = 0
        self._home_again_s = self._quiet_until_s = -math.inf
        self._in_vain.clear()
        self.reason = ""
        if self._flight is not None:
            self._flight.stop_here()

    def on_antenna_off(self) -> None:
        """The antenna has no power."""
        self._connection.end(RouterEvent.ANTENNA_OFF)
        self._end_election()

    def on_ordered_flight(self) -> None:
        """A flight has started by an order."""
        self._flight = None
        self._took_off()

    def on_neighbour_found(self) -> None:
        """A node is in reach that was not. After a silence, the mesh has its time to recover."""
        if self._was_silent:
            self._was_silent = False
            if self._states.repair is Repair.LOST:
                self._lost_since_s = self._parts.now_s

    def on_neighbour_lost(self) -> None:
        """A neighbour is out of reach: nothing waits for it."""
        if self._states.repair in (Repair.ASKING, Repair.NEGOTIATING):
            self._parts.deadlines.set(Due.REPAIR, self._parts.now_s)

    def on_place(self, node: int, place: Location) -> None:
        """`node` says where it is."""
        if self._flight is not None:
            self._flight.on_place(node, place)
        elif self._states.repair is Repair.ASKING and self._all_answered():
            self._negotiate()

    def on_due(self) -> bool:
        """The moment has come that the repair waits for. True if a flight is over."""
        self._parts.deadlines.set(Due.REPAIR, math.inf)
        state = self._states.repair
        if self._flight is not None:
            return self._stands_clear(self._flight)
        if state is Repair.ASKING:
            if self._all_answered() or self._parts.now_s >= self._asked_s + PLACES_WITHIN_S:
                self._negotiate()
            else:
                self._parts.deadlines.set(Due.REPAIR, self._asked_s + PLACES_WITHIN_S)
        elif state is Repair.NEGOTIATING:
            self._decide()
        elif state is Repair.WATCHING:
            self._pass_over_winner()
        return False

    # Lost connection -------------------------------------------------------------------------

    def _notice_loss(self, due_s: float) -> None:
        self._lost_since_s = due_s
        self._connection.end(RouterEvent.LOSS_NOTICED)
        self._connection.give_up_routes()

    def _emergency(self) -> None:
        self._parts.report(MeshEventKind.EMERGENCY)
        if not self._parts.routing.empty():
            self._ask_for_places()
            return
        self._states.happened(RouterEvent.NO_NEIGHBOURS)
        step, self.reason = self._next_step(alone=True)
        if step is not None:
            self._fly(step)

    # Where to --------------------------------------------------------------------------------

    def _next_step(self, alone: bool) -> tuple[Step | None, str]:
        """The flight to make, or None and why not."""
        why_not = self._parts.pilot.why_not_fly()
        if why_not:
            return None, f"cannot fly: {why_not}"
        places = self._parts.places
        steps = [
            Step(place, owner, home=owner == self._connection.gateway)
            for place, owner in (
                (places.good, places.good_id),
                (places.gateway, self._connection.gateway),
            )
            if place is not None and _may_be_flown_to(place)
        ]
        if not steps:
            return None, "knows no place to fly to"
        reason = ""
        for choice, step in enumerate(steps):
            if any(step.place.distance_m(place) < self._radius_m(step) for place in self._in_vain):
                reason = reason or f"was at the place of {step.owner} in vain"
                continue
            if alone:
                return step, ""
            occupant = self._occupant(step)
            if occupant != NO_ROUTE:
                reason = f"the place of {step.owner} is occupied by {occupant}"
            elif step.home and self._parts.now_s < self._home_again_s:
                reason = "another drone flew to the gateway in vain"
            elif (
                choice == 0
                or self._rounds_without_flier >= ROUNDS_WITHOUT_FLIER
                or (reason.startswith("was at"))
            ):
                return step, ""
        return None, reason

    def _occupant(self, step: Step) -> int:
        """A node in reach that stands where `step` leads, or whose place it is; else NO_ROUTE."""
        routing, neighbours = self._parts.routing, self._parts.neighbours
        if step.owner in routing.get_set_of_children():
            return step.owner
        for node, heard in neighbours.places().items():
            if routing.get_direction_to_node(node) == NO_ROUTE:
                continue
            if node == step.owner and heard.heard_s >= self._asked_s:
                return node
            if heard.place.distance_m(step.place) < self._radius_m(step):
                return node
        return NO_ROUTE

    def _radius_m(self, step: Step) -> float:
        """How near a drone stands that occupies a place; at the gateway drones keep aside."""
        return self._options.clearance_m * (2 * PITCH if step.home else 1.0)

    # Election --------------------------------------------------------------------------------

    def _ask_for_places(self) -> None:
        self._states.happened(RouterEvent.ASKED_FOR_PLACES)
        self._asked_s = self._parts.now_s
        self._checked_s = None
        self._parts.deadlines.set(Due.REPAIR, self._asked_s + PLACES_WITHIN_S)
        ask_all_for_places(self._parts.antenna, self._parts.node_id)
        owner = self._parts.places.good_id
        answers_anyway = self._parts.routing.get_set_of_children()
        if owner not in (NO_ROUTE, self._connection.gateway) and owner not in answers_anyway:
            self._connection.ask_for_place(owner)

    def _all_answered(self) -> bool:
        """Whether all neighbours, and the node whose place it wants, said where they are."""
        routing, neighbours = self._parts.routing, self._parts.neighbours
        asked = set(routing.get_set_of_children())
        owner = self._parts.places.good_id
        if owner != NO_ROUTE and routing.get_direction_to_node(owner) != NO_ROUTE:
            asked.add(owner)
        answers = [neighbours.place_of(node) for node in asked]
        return all(heard is not None and heard.heard_s >= self._asked_s for heard in answers)

    def on_bid(self, node: int, score: float, from_: int) -> None:
        """A node of the group bids for the flight, or took off; `from_` relays that."""
        if score in (TOOK_OFF, TOOK_OFF_HOME):
            self._on_take_off_of(node, score, from_)
            return
        now_s = self._parts.now_s
        if score == IN_VAIN:
            self._on_in_vain(node, from_)
            score = NO_BID
        is_best = self._election.heard(node, score, now_s)
        if self._states.connected or self._states.repair is Repair.FLYING:
            return
        if now_s < self._quiet_until_s:
            return
        if is_best:
            self._send_bid(node, score, but_not_to=from_)
        if self._states.repair is Repair.LOST and not self._was_silent:
            self._ask_for_places()
        elif self._states.repair is Repair.NEGOTIATING:
            self._decide()

    def _negotiate(self) -> None:
        step, self.reason = self._next_step(alone=False)
        self._bid = NO_BID if step is None else self._score(step)
        self._parts.report(MeshEventKind.NEGOTIATION_STARTED, detail=f"score {self._bid:.2f}")
        self._states.happened(RouterEvent.BID)
        self._begin_election()

    def _score(self, step: Step) -> float:
        """Distance to the gateway's place in metres, or NO_BID (docs/protocol.md, "Negotiation").

        For the second choice the nearest drone flies, unless another one has a first choice.
        """
        own, gateway = self._parts.pilot.location(), self._parts.places.gateway
        if own is None:
            self.reason = "does not know where it is"
            return NO_BID
        if gateway is None:
            self.reason = "does not know where the gateway is"
            return NO_BID
        distance_m = min(own.distance_m(gateway), MAX_SCORE_M)
        good_id = self._parts.places.good_id
        is_second_choice = step.home and good_id not in (step.owner, NO_ROUTE)
        return 1.0 / (1.0 + distance_m) if is_second_choice else distance_m

    def _begin_election(self) -> None:
        me, now_s = self._parts.node_id, self._parts.now_s
        # As the others will read it: two equal scores must be equal for both nodes.
        score = MovementNegotiationMessage.from_payload(self._bid_packet(me, self._bid)).cost
        settled_s = max(now_s, self._asked_s + PLACES_WITHIN_S) + SETTLE_S
        self._election.start(me, score, now_s, settled_s)
        self._send_bid(me, IN_VAIN if self._was_home() and score < 0 else score)
        self._decide()

    def _bid_packet(self, node: int, score: float) -> bytes:
        me = self._parts.node_id
        return MovementNegotiationMessage(node, me, me, me, score).to_payload()

    def _send_bid(self, node: int, score: float, but_not_to: int = NO_ROUTE) -> None:
        packet = self._bid_packet(node, score)
        for neighbour in sorted(self._parts.routing.get_set_of_children() - {node, but_not_to}):
            self._parts.delivery.send_own(addressed(packet, neighbour))

    def _decide(self) -> None:
        if self._states.repair is not Repair.NEGOTIATING:
            return
        due_s = self._election.due_s(self._parts.routing.get_set_of_children())
        if self._parts.now_s < due_s:
            self._parts.deadlines.set(Due.REPAIR, due_s)
            return
        winner = self._election.winner()
        self._parts.report(MeshEventKind.NEGOTIATION_ENDED, NO_ROUTE if winner is None else winner)
        if winner is None:
            self._rounds_without_flier += 1
            self._end_round()
        elif winner != self._parts.node_id:
            self._winner = winner
            self._states.happened(RouterEvent.BIDS_COUNTED)
            self._parts.deadlines.set(Due.REPAIR, self._parts.now_s + TAKE_OFF_WITHIN_S)
        else:
            step, self.reason = self._next_step(alone=False)
            self._end_round()
            if step is not None:
                code = TOOK_OFF_HOME if step.home else TOOK_OFF
                self._send_bid(self._parts.node_id, code)
                self._fly(step)

    def _on_take_off_of(self, node: int, code: float, from_: int) -> None:
        """A drone of the group flies: the others wait for what comes of it."""
        now_s = self._parts.now_s
        if self._states.connected or node == self._parts.node_id or now_s < self._quiet_until_s:
            return
        timing = self._parts.timing
        self._quiet_until_s = now_s + max(
            timing.connection_lost_after_s - timing.check_period_s, TAKE_OFF_WITHIN_S
        )
        self._rounds_without_flier = 0
        if code >= TOOK_OFF_HOME:
            self._home_again_s = now_s + HOME_AGAIN_S
        self._send_bid(node, code, but_not_to=from_)
        if self._states.repair in (Repair.ASKING, Repair.NEGOTIATING, Repair.WATCHING):
            self._end_round()

    def _on_in_vain(self, node: int, from_: int) -> None:
        """A drone of the group was at the gateway's place in vain: no other one flies there."""
        now_s, timing = self._parts.now_s, self._parts.timing
        if self._states.connected or now_s < self._told_in_vain_s + TAKE_OFF_WITHIN_S:
            return
        self._told_in_vain_s = now_s
        rounds_s = 2 * (timing.connection_lost_after_s + timing.check_period_s)
        self._home_again_s = max(self._home_again_s, now_s + rounds_s)
        self._send_bid(node, IN_VAIN, but_not_to=from_)

    def _was_home(self) -> bool:
        """Whether this drone was at the gateway's place since it was last connected."""
        gateway = self._parts.places.gateway
        radius_m = self._options.clearance_m
        return gateway is not None and any(
            gateway.distance_m(place) < radius_m for place in self._in_vain
        )

    def _pass_over_winner(self) -> None:
        """The winner did not take off: the next best flies."""
        self._election.pass_over(self._winner)
        self._states.happened(RouterEvent.WINNER_MISSED)
        self._begin_election()

    def _end_round(self) -> None:
        """The election is over; the time without a gateway counts from its first check on."""
        checked_s = self._checked_s
        self._states.happened(RouterEvent.ROUND_OVER)
        self._end_election()
        if checked_s is not None:
            self._notice_loss(checked_s)

    def _end_election(self) -> None:
        self._election.clear()
        self._checked_s = None
        self._parts.deadlines.set(Due.REPAIR, math.inf)

    # Flight ----------------------------------------------------------------------------------

    def _fly(self, step: Step) -> None:
        self._parts.report(MeshEventKind.FLIGHT_DECIDED, step.owner)
        flight = RepairFlight(
            self._parts,
            self._introduce,
            step.owner,
            step.place,
            self._goal(step),
            self._options,
        )
        flight.stops_when_connected = step.home
        self._in_vain.append(step.place)
        self._parts.neighbours.forget_all()
        self._parts.routing.node_moved_location()
        flight.start()
        self._took_off()
        self._flight = flight

    def _goal(self, step: Step) -> Location:
        """A living gateway stands at its place, and in a silent medium any node may."""
        clearance_m = self._options.clearance_m
        if self._parts.neighbours.silent:
            known = [heard.place for heard in self._parts.neighbours.places().values()]
            known += [step.place, *filter(None, [self._parts.places.gateway])]
            return own_spot(step.place, self._parts.node_id, clearance_m, known)
        if step.home or self._options.avoid_wrecks:
            origin = self._parts.pilot.location() or step.place
            return beside(step.place, origin, PITCH * clearance_m)
        return step.place

    def _took_off(self) -> None:
        self._connection.end(RouterEvent.TOOK_OFF)
        self._end_election()
        self._parts.places.left_own_place(self._connection.gateway)

    def may_connect(self, node: int, know_gateway: bool) -> bool:
        """Whether the router may take up a connection now, through `node`.

        In flight for a repair it would be a relay that is gone the next moment, so it keeps out,
        unless it is to stop where it is connected. A gateway for the group that it left behind is
        a reason to do so.
        """
        flight = self._flight
        if flight is None:
            return True
        if know_gateway and node in flight.group:
            flight.stop_when_connected()
        return flight.stops_when_connected

    def on_flight_second(self) -> None:
        """The drone is still in flight."""
        if self._flight is not None:
            self._flight.each_second()

    def on_arrived(self) -> bool:
        """The drone is at its goal. True if the flight is over."""
        if self._flight is None:
            return True
        if self._flight.arrived():
            self._parts.deadlines.set(Due.REPAIR, self._parts.now_s + ASK_AGAIN_S)
        return False

    def _stands_clear(self, flight: RepairFlight) -> bool:
        if not flight.on_ground:
            return False
        if flight.ask_again():
            self._parts.deadlines.set(Due.REPAIR, self._parts.now_s + ASK_AGAIN_S)
            return False
        return True

    def on_landed(self) -> None:
        """The flight is over."""
        self._flight = None
        self._connection.end(RouterEvent.LANDED)

    def status(self) -> str:
        """What the repair does and why, in a few words; empty while nothing is to be repaired."""
        state = self._states.repair
        if self._flight is not None:
            place = self._flight.goal.in_words()
            return "landed, looks for others" if self._flight.on_ground else f"flies to {place}"
        if self._states.connected or state is Repair.FLYING:
            return ""
        words = [state.value]
        if state in (Repair.NEGOTIATING, Repair.WATCHING):
            words.append(f"bid {self._bid:.1f}" if self._bid >= 0 else "no bid")
        if state is Repair.WATCHING:
            words.append(f"{self._winner} has won")
        if self._parts.neighbours.silent:
            words.append("hears no node at all, the medium may be down")
        if self.reason:
            words.append(self.reason)
        return ", ".join(words)


def _may_be_flown_to(place: Location) -> bool:
    """Whether a drone may go there: a LOCATION may hold any numbers."""
    try:
        check_goal(*place)
    except GoalRefused:
        return False
    return True
