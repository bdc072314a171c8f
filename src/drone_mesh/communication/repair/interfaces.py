"""What a repair strategy and its router expect of each other.

A strategy is driven like the rest of the mesh software: without a clock, thread or randomness of
its own. docs/strategies.md shows how to write one.
"""

# ruff: noqa: B027 - a strategy overrides only those of the calls that it needs

from __future__ import annotations

import abc
import math
from collections import deque
from dataclasses import dataclass
from typing import Mapping, NamedTuple

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.places import KnownPlaces, PlaceRequests
from drone_mesh.communication.control.router_states import RepairState, RouterEvent, RouterStates
from drone_mesh.communication.events.observer import MeshEventKind, Reporter
from drone_mesh.communication.interfaces import NO_ROUTE, IWirelessCommunication
from drone_mesh.communication.repair.election import NO_BID
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.spots import NEAR, PITCH, at_whole_metres, may_be_flown_to
from drone_mesh.communication.timing import Deadlines, Due, MeshTiming
from drone_mesh.communication.wire.messages import (
    GatewayPlace,
    MovementNegotiationMessage,
    addressed,
)
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location

RADIO_FAILED = "its radio does not work"
JAMMED = "its channel is jammed"
TRIED_SPOTS = 6  # of two turns; more take all spots around a place, so that the drone drifts away


class Step(NamedTuple):
    """A possible flight of a drone."""

    place: Location
    owner: int = NO_ROUTE  # the node at that place; NO_ROUTE: none; own id: a return
    home: bool = False  # whether it is the gateway's place
    look: bool = False  # whether the drone comes back if no gateway answers there


class NeighbourView(NamedTuple):
    """What a router knows about a neighbour."""

    place: Location | None  # where it is, or its destination; None: not reported
    age_s: float  # age of the place; infinity if unknown
    hops: int  # to its gateway, as last reported; 255: it has none


@dataclass(eq=False)
class RepairActions(abc.ABC):
    """A strategy's view of its router, and its possible actions. Places in metres, x east.

    ConnectionRepair adds what changes the course of a repair.
    """

    node_id: int
    _states: RouterStates
    _control: IControlPlane
    _options: RepairOptions
    _timing: MeshTiming
    _deadlines: Deadlines
    _antenna: IWirelessCommunication
    _engine: IDroneEngine
    _pilot: Pilot
    _requests: PlaceRequests
    _places: KnownPlaces
    _report: Reporter

    def __post_init__(self) -> None:
        self.medium, self._neighbours = self._antenna.medium, self._control.neighbours
        self.range_m = self._options.range_m  # of the radio, as far as known
        self.clearance_m = self._options.clearance_m  # least distance between drones at rest
        self.check_period_s = self._timing.check_period_s
        # The time without a gateway until the emergency
        self.connection_lost_after_s = self._timing.connection_lost_after_s
        # For so long a bid counts, and the bids of neighbours are awaited
        self.bids_within_s = self._control.bids_within_s
        self._tried_goals: list[Location] = []  # goals of this drone since it was last connected
        self._tried_spots: deque[Location] = deque(maxlen=TRIED_SPOTS)  # where it landed for these

    # Views -----------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """The time, in seconds of the core's clock."""
        return self._deadlines.now_s

    @property
    def connected(self) -> bool:
        """Whether a gateway answers."""
        return self._states.connected

    @property
    def state(self) -> RepairState:
        """The current repair state."""
        return self._states.repair

    @property
    def silent(self) -> bool:
        """Whether all neighbours (2 or more) fell silent together, so the medium may be down."""
        return self._neighbours.silent

    def hears_power(self) -> bool | None:
        """Whether there is power in the channel of its radio now; None: it cannot measure it."""
        return self._antenna.hears_power()

    def neighbours(self) -> Mapping[int, NeighbourView]:
        """The nodes in direct reach."""
        return {node: self.view(node) for node in self._control.routes.get_set_of_children()}

    def view(self, node: int) -> NeighbourView:
        """What is known about a node, a neighbour or not."""
        heard, hops = self._neighbours.place_of(node), self._neighbours.hops_of(node)
        if heard is None:
            return NeighbourView(None, math.inf, hops)
        return NeighbourView(heard.place, self.now_s - heard.heard_s, hops)

    def heard_by(self, node: int) -> frozenset[int]:
        """The nodes that a neighbour has shown to hear; empty if the technique has no such news."""
        return self._control.routes.heard_by(node)

    def has_own_way(self, node: int) -> bool:
        """Whether a node in at most two hops reaches the gateway, and not through this node."""
        has_way = self._control.routes.has_own_way(node)
        return self._neighbours.hops_of(node) <= self._control.hops if has_way is None else has_way

    @property
    def in_motion(self) -> bool:
        """Whether drones move by themselves: a link that was lost may come back."""
        motion = self._neighbours.motion
        return motion.moved_since(self.now_s - motion.within_s)

    def is_unheard(self) -> bool:
        """Whether this node hears others but none of them hears it."""
        return bool(self._neighbours.deaf()) and not self.neighbours()

    def reachable(self) -> Mapping[int, NeighbourView]:
        """All nodes with a route to them and a reported place."""
        places = self._neighbours.places
        return {node: self.view(node) for node in places if self.reaches(node)}

    def reaches(self, node: int) -> bool:
        """Whether there is a route to `node`."""
        return self._control.routes.get_direction_to_node(node) != NO_ROUTE

    @property
    def lost_next_hop(self) -> int:
        """The next hop to the gateway before the connection was lost; NO_ROUTE: unknown."""
        return self._places.good_id

    @property
    def steps(self) -> list[Step]:
        """The flights back: to the lost next hop, the gateway, and where it was connected last.

        The last one has the owner NO_ROUTE; it is for a drone that has no other.
        """
        places, gateway = self._places, self._control.gateway
        candidates = [
            (places.good, places.good_id),
            (places.gateway, gateway),
            (places.connected_at, NO_ROUTE),
        ]
        return [
            Step(place, owner, home=owner == gateway != NO_ROUTE)
            for known, owner in candidates
            for place in self.within_fence(known)
            if may_be_flown_to(place)
        ]

    def places_of_others(self) -> list[Step]:
        """Where the other nodes were of which it knows, the one that was heard last first."""
        known = sorted(self._neighbours.places.items(), key=lambda one: -one[1].heard_s)
        return [
            Step(place, node)
            for node, heard in known
            for place in self.within_fence(heard.place)
            if node != self.node_id and may_be_flown_to(place)
        ]

    def may_lead_to_gateway(self, place: Location) -> bool:
        """Whether a gateway may be in reach of a node there, within the bounds for its place."""
        return self._places.is_possible(place, self.range_m, gateway=True)

    def within_fence(self, place: Location | None) -> list[Location]:
        """A known place, or the nearest one to it that the fence allows, if there is one."""
        fence = self._engine.fences()
        if place is None or not fence:
            return [] if place is None else [place]
        inside = fence.nearest_inside(at_whole_metres(place).to_vector())
        return [] if inside is None else [Location.from_vector(inside)]

    def why_not_there(self, place: Location) -> str:
        """Why the fence does not allow a place; empty if it does."""
        return self._engine.fences().why_not(place.to_vector())

    @property
    def gateway_place(self) -> Location | None:
        """The last reported place of the preferred gateway."""
        return self._places.gateway

    def own_place(self) -> Location | None:
        """The position of this drone; None: unknown."""
        return self._pilot.location()

    def why_not_fly(self) -> str:
        """Why the drone cannot fly for a repair; empty if it can.

        Without a radio it would be connected nowhere, and tell nobody where it lands.
        """
        if not self._antenna.works():
            return RADIO_FAILED
        return self._engine.why_not_repair()

    @abc.abstractmethod
    def goal_of(self, step: Step) -> Location:
        """Where a flight for this step would end, clear of other drones, silent ones included."""

    def was_at(self, step: Step) -> bool:
        """Whether this drone is at the step's place, or flew there since its last connection."""
        radius_m = self.clearance_m * (2 * PITCH if step.home else NEAR)
        here = self._pilot.place() if step.owner == NO_ROUTE else None
        places = [*self._tried_goals, *filter(None, [here])]
        return any(step.place.distance_m(place) < radius_m for place in places)

    # Actions ---------------------------------------------------------------------------------

    def try_again(self) -> None:
        """Allow flights to places that were tried in vain; each ends at another side."""
        self._tried_goals.clear()

    @abc.abstractmethod
    def fly(self, step: Step, until_connected: bool = False) -> None:
        """Fly there and land clear of other drones; `on_landed` reports the landing.

        Nothing happens if the drone cannot fly (`why_not_fly`).

        `until_connected`: land as soon as a gateway answers. The routes are forgotten.
        """

    def leave(self) -> None:
        """Give up the connection and tell the neighbours, before a flight from where it is needed.

        The connection may come back when the flight is over.
        """
        self._control.leave()

    def bid(
        self,
        score: float,
        node: int | None = None,
        but_not_to: int = NO_ROUTE,
        about: Location | None = None,
        only_to: int = NO_ROUTE,
    ) -> None:
        """Send a bid to all neighbours, or one; `node` is its creator if it is relayed.

        `about`: the goal of a flight that it announces, or the gateway's place where one failed.
        """
        me = self.node_id
        creator = me if node is None else node
        packet = MovementNegotiationMessage(creator, me, me, me, score).to_payload()
        if about is not None:
            packet = GatewayPlace(self._control.gateway, about, 0.0).appended_to(packet)
        for neighbour in sorted(self._control.routes.get_set_of_children() - {creator, but_not_to}):
            if only_to in (neighbour, NO_ROUTE):
                self._control.delivery.send_own(addressed(packet, neighbour))

    def ask_places(self) -> None:
        """Request the places of all nodes in range; the answers arrive in `on_place`."""
        self._requests.ask_all()

    def ask_place(self, node: int) -> None:
        """Request the place of one node, along the route to it."""
        self._requests.ask(node)

    def announce_place(self, place: Location) -> None:
        """Send the place to which this drone flies to all nodes in range."""
        self._requests.announce(place)

    def present(self) -> None:
        """Introduce this node to all nodes in range."""
        self._control.introduce()

    def wait_until(self, at_s: float) -> None:
        """Call `on_time` at this time instead of an earlier request; infinity: not at all."""
        self._deadlines.set(Due.REPAIR, at_s)

    def happened(self, event: RouterEvent) -> None:
        """Change the states of the router (see router_states). An election needs this."""
        self._states.happened(event)

    @abc.abstractmethod
    def end_round(self) -> None:
        """An election is over. Count the time without a gateway from its first check."""

    def report(self, kind: MeshEventKind, peer: int = NO_ROUTE, detail: str = "") -> None:
        """Report an event to the node's observer."""
        self._report(kind, peer, detail)


SILENCE_PATIENCE = 5.0  # the factor on a node's patience if its medium may be down


class IRepairStrategy(abc.ABC):
    """A router's reaction to a lost connection. All calls come from one thread, one at a time.

    Only `on_emergency` is required. A strategy is not asked for actions while its node is connected
    or flies for a repair.
    """

    # Read by the router, most of them shown to users as RepairStatus:
    reason = ""  # why the drone does not fly, as short text
    listens = False  # it must not connect yet
    own_bid = NO_BID  # in an election
    bid_unit = ""  # of bids above 1
    bids_for = NO_ROUTE  # the node whose place it would take
    winner = NO_ROUTE  # of an election; it must take off

    def start(self, mesh: RepairActions) -> None:
        """Called once, before everything else."""
        self.mesh = mesh

    def patience(self, silent: bool) -> float:
        """The wait before an emergency, as a multiple of `connection_lost_after`.

        Called after `on_gateway_lost`, at each check from then on until the emergency, and when a
        node is heard after a silence, from which moment the time counts anew. `silent`: see
        RepairActions.silent.
        """
        return SILENCE_PATIENCE if silent else 1.0

    def on_connected_check(self) -> None:
        """The periodic check of a connected drone at rest: it may prepare, or `leave`."""

    def on_gateway_lost(self) -> None:
        """A check found that no gateway answers."""

    @abc.abstractmethod
    def on_emergency(self) -> None:
        """No gateway answered for `connection_lost_after`. Called at each check from then on."""

    def on_gateway_found(self) -> None:
        """A gateway answers."""

    def on_stopped(self) -> None:
        """The drone flies by order, or the antenna is off: give up what is under way."""

    def on_neighbour_found(self, node: int) -> None:
        """A new node is in reach."""

    def on_neighbour_lost(self, node: int) -> None:
        """A neighbour no longer takes packets."""

    def on_place(self, node: int, place: Location) -> None:
        """A node reported where it is, or where it flies to."""

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """`node` bids; the neighbour `from_` sent or relayed that bid.

        `about`: the goal of its flight, or the gateway's place to which it flew in vain.
        """

    def on_time(self) -> None:
        """The timer of `wait_until` has expired."""

    def on_landed(self) -> None:
        """A flight for the repair is over, and the drone is clear of others."""
