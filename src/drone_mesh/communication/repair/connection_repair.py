"""ConnectionRepair: repairs a router's connection by a strategy, once it is lost for too long.

It notices the loss, waits, flies for the strategy, and keeps clear of other drones.
docs/repair.md, "Lost connection" and "Flight".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.control.router_states import RepairState, RouterEvent
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import NO_BID, TOOK_OFF, TOOK_OFF_HOME
from drone_mesh.communication.repair.interfaces import (
    JAMMED,
    RADIO_FAILED,
    IRepairStrategy,
    RepairActions,
    Step,
)
from drone_mesh.communication.repair.lost_mesh import ANSWERS_S, ROUNDING_S, LastFlight
from drone_mesh.communication.repair.repair_flight import ASK_AGAIN_S, RepairFlight
from drone_mesh.communication.repair.spots import (
    PITCH,
    Landing,
    TakenPlaces,
    above_ground,
    at_whole_metres,
    own_spot,
    spot_beside_rivals,
)
from drone_mesh.communication.repair.status import NO_CHECK_YET, NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.communication.timing import FLIGHT_POSITION_PERIOD_S, Due
from drone_mesh.communication.wire.messages import GatewayPlace, MovementNegotiationMessage
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location

MOVING_PATIENCE = 3.0  # while drones move by themselves, a lost link may come back
NOT_YET_CONNECTED = "it may still be connected for the first time"
JOINING_PATIENCE = 5.0  # 100 nodes with a key take a minute to connect through one channel


@dataclass(eq=False)
class ConnectionRepair(RepairActions):
    """The repair of one router. It drives the `RepairState` of the router's states."""

    _strategy: IRepairStrategy
    _has_key: bool

    def __post_init__(self) -> None:
        super().__post_init__()
        self._taken = TakenPlaces(
            self.node_id,
            self._deadlines,
            self._neighbours,
            self._places,
            self._options,
            lambda place: not self.why_not_there(place),
            self._engine.plan,
        )
        taken, engine, neighbours = self._taken, self._engine, self._neighbours
        self._last = LastFlight(self, self._options, engine, self._pilot, neighbours, taken)
        again_s = self.medium.policy.ask_sealed_s if self._has_key else ASK_AGAIN_S
        self._ask_again_s = self.medium.stretched(again_s)
        # Valid from LOSS_NOTICED until the router is AT_REST:
        self._lost_since_s = math.inf
        self._emergency_s = math.inf  # when the time is up, as far as known
        self._checked_s: float | None = None  # when the first check during an election was due
        self._was_silent = False
        self._joins_until_s = math.inf  # once it was connected, or waited too long: in the past
        self._flight: RepairFlight | None = None
        self._flies_to_place_of = NO_ROUTE
        self._landed_unheard = False  # away from where it stood, and it has heard no node since
        self._strategy.start(self)

    # What the router reports -----------------------------------------------------------------

    def on_unconnected_check(self, due_s: float) -> None:
        """A check, due at `due_s`, finds the router unconnected and no answer pending.

        Time is counted between due times, so that a late check does not cost a period.
        """
        state, here = self._states.repair, self._pilot.place()
        if here is not None:
            self._neighbours.motion.reported(self.node_id, here, due_s)
        if state is RepairState.AT_REST:
            self._notice_loss(due_s)
        if state in (RepairState.AT_REST, RepairState.LOST) and self._last.becomes_due(due_s):
            self._strategy.on_stopped()
            self.ask_places()
            self._look_again()
        elif state is RepairState.LOST:
            self._was_silent = self.silent
            self._plan_emergency()
            if due_s >= self._emergency_s - ROUNDING_S:
                self._emergency()
        elif state is not RepairState.AT_REST and self._checked_s is None:
            self._checked_s = due_s

    def on_connected_check(self) -> None:
        if self.state is RepairState.AT_REST:
            self._strategy.on_connected_check()

    def on_connected(self) -> None:
        self._joins_until_s = -math.inf
        self._last.begin_anew()
        self._clear()
        self._tried_goals.clear()
        self._tried_spots.clear()
        self._strategy.reason = ""
        self._strategy.on_gateway_found()
        if self._flight is not None:
            self._flight.stop_here(self._control.next_hop())

    def on_antenna_off(self) -> None:
        self._control.end(RouterEvent.ANTENNA_OFF)
        self._last.begin_anew()
        self._clear()
        self._strategy.reason = ""
        self._strategy.on_stopped()

    def on_ordered_flight(self) -> None:
        self._last.begin_anew()
        self._flight = None
        self._took_off()

    def on_neighbour_found(self, node: int) -> None:
        """A new node is in reach. After a silence, give the mesh time to recover.

        A drone that landed while no radio was heard may stand beside one that it never heard of.
        """
        if self._was_silent:
            self._was_silent = False
            if self._states.repair is RepairState.LOST:
                self._lost_since_s = self.now_s
                self._plan_emergency()
        self._strategy.on_neighbour_found(node)
        if self._flight is not None and not self._flight.on_ground:
            self._requests.ask_neighbour(node)  # before the next second it may have landed
        if self._landed_unheard:
            self._landed_unheard = False
            if not (self.connected or self._strategy.listens):
                self._check_spot()

    def on_neighbour_lost(self, node: int) -> None:
        self._strategy.on_neighbour_lost(node)

    def on_place(self, node: int, place: Location) -> None:
        if self._flight is None:
            self._strategy.on_place(node, place)
        elif self._flight.lands:
            self.on_taken(place)
        else:
            self._flight.on_place(node, place)

    def on_taken(self, place: Location) -> None:
        """A drone is at `place` or flies there, or was last heard there."""
        flight = self._flight
        if flight is not None and self._last.must_wait(flight):
            flight.pause()
        elif flight is not None:
            flight.on_taken(place)

    @receives(MessageType.MOVEMENT_NEGOTIATION)
    def on_bid_packet(self, payload: bytes, creator: int, from_: int) -> None:
        """A neighbour bids for the flight, or announces one to the gateway's place."""
        if creator != self.node_id:
            bid = MovementNegotiationMessage.from_payload(payload)
            gateway = GatewayPlace.from_payload(payload)
            self.on_bid(creator, bid.cost, from_, None if gateway is None else gateway.place)

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """A node of the group bids; `from_` sent or relayed that bid (see IRepairStrategy)."""
        if score in (TOOK_OFF, TOOK_OFF_HOME):
            self._neighbours.motion.flies_for_repair(node, self.now_s)
            if about is not None:
                self._neighbours.set_place(node, about, self.now_s, is_goal=True)
                self.on_taken(about)
        if self._last.due is None:
            self._strategy.on_bid(node, score, from_, about)

    def on_due(self) -> bool:
        """The repair's timer has expired. Returns whether a flight is over."""
        self.wait_until(math.inf)
        flight = self._flight
        if flight is None:
            (self._strategy.on_time if self._last.due is None else self._end_work)()
            return False
        if not flight.on_ground:
            if self._last.must_wait(flight):
                self._look_again()
            elif flight.paused:
                flight.fly_on()
            else:
                self._requests.ask_all()
            return False
        is_over = not flight.ask_again()
        if not is_over:
            self._await_answers()
        return is_over

    def status(self) -> RepairStatus:
        """The current activity of the repair, and its reason."""
        state, flight, strategy = self.state, self._flight, self._strategy
        reason = (not self._last.due and self._last.why_not_repair()) or strategy.reason
        if flight is not None:
            return RepairStatus(
                state,
                reason="a gateway answers" if self.connected else "",
                place_of=self._flies_to_place_of,
                goal=flight.goal,
                landed=flight.on_ground,
                ends=self._last.due.words if self._last.due and flight.lands else "",
            )
        if self.connected or state is RepairState.FLYING:
            return NOTHING_TO_REPAIR
        if state is RepairState.AT_REST and not reason:
            return NO_CHECK_YET if self._antenna.on() else NOTHING_TO_REPAIR
        bids = state in (RepairState.NEGOTIATING, RepairState.WATCHING)
        return RepairStatus(
            state,
            reason,
            bid=strategy.own_bid if bids else NO_BID,
            bid_unit=strategy.bid_unit,
            place_of=strategy.bids_for if bids else NO_ROUTE,
            winner=strategy.winner if state is RepairState.WATCHING else NO_ROUTE,
            emergency_s=self._emergency_s,
            silent=self.silent,
            jammed=strategy.reason == JAMMED,
        )

    # Actions of the strategy -----------------------------------------------------------------

    def fly(self, step: Step, until_connected: bool = False) -> None:
        """See RepairActions, which describes the functions below as well."""
        if self.why_not_fly():
            return
        if not all(map(math.isfinite, step.place)):  # beside it no spot would be free
            self._strategy.reason = "its strategy names no place to fly to"
            return
        goal = self.goal_of(step)
        why_not = self.why_not_there(goal)
        if why_not:
            self._strategy.reason = f"no place to fly to: {why_not}"
            self._tried_goals.append(step.place)
            self._tried_spots.append(goal)
            return
        self._report(MeshEventKind.FLIGHT_DECIDED, step.owner)
        flight = self._new_flight(step, goal)
        flight.stops_when_connected = until_connected or step.home
        self._flies_to_place_of = step.owner if step in self.steps else NO_ROUTE
        if step.owner != self.node_id:
            self._tried_goals.append(step.place)
            self._tried_spots.append(flight.goal)
        elif self._flight is not None and self._tried_goals:
            self._tried_goals.pop()  # it turns back before it has been there
            self._tried_spots.pop()
        self._set_out(flight)

    def why_not_fly(self) -> str:  # noqa: D102
        joins = self.now_s < self._joins_until_s - ROUNDING_S
        why_not = self._last.why_not_repair() or super().why_not_fly()
        return why_not or (NOT_YET_CONNECTED if joins else "")

    def _end_work(self) -> None:
        """Set out for the last time, unless somebody is in the way: a check asks again, then."""
        ending = self._last.due
        assert ending is not None  # asked before
        place, self._strategy.reason = self._last.may_set_out(ending)
        if place is None:
            return
        self._report(MeshEventKind.FLIGHT_DECIDED, detail=ending.words)
        flight = self._new_flight(Step(place), place, lands=True)
        flight.stops_when_connected = ending.waits_until_s == math.inf
        self._flies_to_place_of = NO_ROUTE
        self._set_out(flight)

    def _look_again(self) -> None:
        answers_s = self.now_s + self.medium.stretched(ANSWERS_S)
        self.wait_until(min(self._deadlines.at_s[Due.REPAIR], answers_s))

    def _set_out(self, flight: RepairFlight) -> None:
        self._neighbours.forget_all()
        self._neighbours.takes_off(by_order=False)
        self._control.routes.node_moved_location()
        flight.fly_on()
        self._flight = None
        self._took_off()
        self._flight = flight

    def end_round(self) -> None:  # noqa: D102
        checked_s = self._checked_s
        self._states.happened(RouterEvent.ROUND_OVER)
        self._clear()
        if checked_s is not None:
            self._notice_loss(checked_s)

    # Flight ----------------------------------------------------------------------------------

    def may_connect(self, node: int, know_gateway: bool) -> bool:
        """Whether the router may now connect through `node`.

        During a repair flight it would be a relay that is soon gone, so it stays unconnected
        unless the flight may end at a connection. A flight may also do so as soon as a node of the
        group that it left has a gateway.
        """
        flight = self._flight
        if flight is None:
            return not self._strategy.listens
        if know_gateway and node in flight.group:
            flight.stop_when_connected()
        return flight.stops_when_connected

    def on_flight_second(self) -> None:
        flight = self._flight
        if flight is None:
            return
        flight.each_second()
        if self.now_s < flight.last_ask_s() < self.now_s + FLIGHT_POSITION_PERIOD_S:
            self.wait_until(flight.last_ask_s())
        if flight.lands:
            self._last.hurry(flight)
        elif self._last.becomes_due(self.now_s, flies=True):
            self._end_work()

    def on_arrived(self) -> bool:
        """The drone is at the end of a leg. Returns whether the flight is over.

        With the antenna off it is, unless it is the last one: nobody would hear where another leg
        ends.
        """
        flight = self._flight
        if flight is None or not (flight.lands or self._antenna.on()):
            return True
        is_there = flight.arrived()
        if flight.paused:
            self._look_again()
        elif is_there and not flight.lands:
            self._await_answers()
        return is_there and flight.lands

    def on_landed(self) -> None:
        flight, self._flight = self._flight, None
        was_repair = flight is not None
        self._landed_unheard = flight is not None and not (
            flight.leads_back or flight.lands or self._neighbours.ids()
        )
        if was_repair and self._flies_to_place_of == self._control.gateway and not self.connected:
            self._places.gateway_not_found()
        self._control.end(RouterEvent.LANDED)
        if flight is not None and flight.lands:
            self._last.landed()
        elif was_repair and self._last.due is None:
            self._strategy.on_landed()

    def _check_spot(self) -> None:
        """Ask who else is here, as after a flight, and step aside if anybody is too near."""
        here = self.own_place()
        if here is not None:
            step = Step(here, self.node_id)
            flight = self._new_flight(step, here)
            self._flies_to_place_of = NO_ROUTE
            self._took_off()
            self._flight = flight
            flight.ask_on_ground()
            self._await_answers()

    def _new_flight(self, step: Step, goal: Location, lands: bool = False) -> RepairFlight:
        return RepairFlight(
            self.node_id,
            self._pilot,
            self._requests,
            self._neighbours,
            self.present,
            step,
            goal,
            self._options,
            self._taken,
            self._landing(step),
            lands,
        )

    def _await_answers(self) -> None:
        self.wait_until(self.now_s + self._ask_again_s)

    def goal_of(self, step: Step) -> Location:  # noqa: D102
        if step.owner == self.node_id:
            return above_ground(step.place)
        place, landing = at_whole_metres(step.place), self._landing(step)
        known = [place, *self._taken.all(), *self._tried_spots]
        rivals, allows = self._rivals(step), self._taken.allows
        if self.silent:
            return own_spot(place, self.node_id, self._options, known, allows, rivals)
        if rivals:
            return spot_beside_rivals(
                place, self.node_id, rivals, landing, self._options, known, allows
            )
        return self._taken.at_or_beside(place, landing, self._tried_spots)

    def _rivals(self, step: Step) -> list[int]:
        """Drones out of reach that may fly to the same place, because it is within their range."""
        neighbours = self._neighbours
        others = neighbours.out_of_reach() - {step.owner, self._control.gateway}
        places = {node: neighbours.place_of(node) for node in others}
        return [
            node
            for node, heard in places.items()
            if heard is not None and heard.place.distance_m(step.place) < self.range_m
        ]

    def _landing(self, step: Step) -> Landing:
        """Where the drone comes from, and which links it needs at the place of the lost node.

        These are the links of the lost node: to the neighbours of this drone, to the place that it
        leaves, which another one may take, and to a relay that it does not know, on the way to the
        gateway.
        """
        near_m = 2 * PITCH * self.clearance_m
        tried = [spot for spot in self._tried_spots if spot.distance_m(step.place) < near_m]
        neighbours = self._neighbours
        heard = [neighbours.place_of(node) for node in sorted(neighbours.ids() - {step.owner})]
        origin = self.own_place() or step.place
        places = [origin, *(known.place for known in heard if known is not None)]
        links = [place for place in places if place.distance_m(step.place) < self.range_m]
        gateway = self.gateway_place
        if gateway is not None and not step.home:
            away_m = min(self.range_m - PITCH * self.clearance_m, step.place.distance_m(gateway))
            links.append(step.place.towards(gateway, away_m))
        if tried:  # there it heard nobody: now from the other side
            origin = Location(*(2.0 * mid - spot for mid, spot in zip(step.place, tried[-1])))
        return Landing(origin, [] if step.home else links)

    def _emergency(self) -> None:
        if self._antenna.works():
            self._report(MeshEventKind.EMERGENCY)
            self._strategy.on_emergency()
        elif self._strategy.reason != RADIO_FAILED:
            self._report(MeshEventKind.EMERGENCY, detail=f"{RADIO_FAILED}: it stays")
            self._strategy.reason = RADIO_FAILED

    def _plan_emergency(self) -> None:
        patience = self._strategy.patience(self.silent)
        motion = self._neighbours.motion
        if motion.moved_since(self._lost_since_s - motion.within_s):
            patience = max(patience, MOVING_PATIENCE)
        emergency_s = self._lost_since_s + self.connection_lost_after_s * patience
        if self._joins_until_s == math.inf:
            longest_s = self.connection_lost_after_s * JOINING_PATIENCE
            self._joins_until_s = self._lost_since_s + longest_s
        self._emergency_s = max(emergency_s, self._joins_until_s)

    def _notice_loss(self, due_s: float) -> None:
        self._lost_since_s = due_s
        self._control.end(RouterEvent.LOSS_NOTICED)
        self._control.give_up_routes()
        self._strategy.on_gateway_lost()
        self._plan_emergency()

    def _took_off(self) -> None:
        self._landed_unheard = False
        self._control.end(RouterEvent.TOOK_OFF)
        self._clear()
        self._strategy.reason = ""
        self._strategy.on_stopped()
        self._places.left_own_place(self._control.gateway)
        self._neighbours.motion.forget(self.node_id)

    def _clear(self) -> None:
        """Forget what was under way, except the end of a flight, which is always processed."""
        self._checked_s = None
        if self._flight is None:
            self.wait_until(math.inf)
