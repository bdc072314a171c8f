"""Flights: what a node does when its drone takes off, flies and has landed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Iterable

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import due
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.control.router_states import RepairState, RouterStates
from drone_mesh.communication.events.observer import MeshEventKind, Reporter
from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.communication.orders.intake import OrderIntake
from drone_mesh.communication.repair.connection_repair import ConnectionRepair
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.drone.location import Location

GOAL_AGAIN_S = 0.15  # broadcasts are not acknowledged
SHORT_FLIGHT = 0.25  # of the range: the discs before and after share 84 % of their area


@dataclass(eq=False)
class Flights:
    """The flights of a gateway, which is connected anywhere."""

    _pilot: Pilot
    _control: IControlPlane
    _orders: OrderIntake
    _report: Reporter
    _requests: PlaceRequests
    _deadlines: Deadlines

    def notice_s(self) -> float:
        """How long before it takes off it tells the others; a gateway is looked for anyway."""
        return 0.0

    def departs(self) -> None:
        """The drone will leave its place because of an order: those who lose it may follow it."""
        self._announce_goal()

    def is_noticed(self) -> bool:
        """Whether those that it may cut off know where it is about to fly, or had their time."""
        return True

    def told(self, neighbour: int, goal: Location) -> None:
        """A neighbour acknowledged that the drone flies there."""

    def not_told(self, neighbour: int) -> None:
        """A neighbour did not take the goal that was announced."""

    def took_off(self) -> None:
        """The drone leaves its place because of an order."""

    def _announce_goal(self, acknowledged_by: Iterable[int] = ()) -> None:
        goal = self._pilot.destination
        if goal is not None:
            self._requests.announce(goal, acknowledged_by)
            self._deadlines.set(Due.GOAL, self._deadlines.now_s + GOAL_AGAIN_S)

    @due(Due.GOAL)
    def announce_goal_again(self) -> None:
        self._deadlines.set(Due.GOAL, math.inf)
        goal = self._pilot.destination
        if goal is not None:
            self._requests.announce(goal)

    @due(Due.ASK_POSITION)
    def watch(self) -> None:
        """Look where the drone is, in flight."""
        if self._pilot.watch():
            self._landed()

    def _landed(self) -> None:
        """The drone is at another place and has other neighbours."""
        self._control.neighbours.forget_all()
        self._control.routes.node_moved_location()
        self._report(MeshEventKind.LANDED)
        self._control.introduce()
        self._orders.on_landed()


@dataclass(eq=False)
class RouterFlights(Flights):
    """The flights of a router, by order or for a repair."""

    _states: RouterStates
    _repair: ConnectionRepair
    _antenna: IWirelessCommunication

    def __post_init__(self) -> None:
        self._untold: set[int] = set()
        self._waits_until_s = -math.inf

    def notice_s(self) -> float:
        """How long before it takes off it tells its neighbours, which lose its routes in flight."""
        return 0.0 if self._pilot.goal else self._repair.medium.takes_off_after_s

    def departs(self) -> None:
        """The drone leaves its place because of an order: tell the neighbours where it flies.

        Those that may have this router as their next hop acknowledge it.
        """
        medium, control = self._repair.medium, self._control
        hops_of, others = control.neighbours.hops_of, control.neighbours.ids()
        self._untold = {node for node in others if hops_of(node) >= control.hops}
        self._untold.discard(control.next_hop())  # its hops may not be known
        self._waits_until_s = self._deadlines.now_s + medium.takes_off_within_s
        self._announce_goal(acknowledged_by=sorted(self._untold))

    def is_noticed(self) -> bool:
        self._untold &= self._control.neighbours.ids()
        return not self._untold or self._deadlines.now_s >= self._waits_until_s

    def told(self, neighbour: int, goal: Location) -> None:
        if goal == self._pilot.departure:  # and not that of an order that was replaced
            self._untold.discard(neighbour)

    def not_told(self, neighbour: int) -> None:
        goal = self._pilot.departure
        if goal is not None and neighbour in self._untold and not self.is_noticed():
            self._requests.tell_goal(goal, neighbour)

    def took_off(self) -> None:
        goal = self._pilot.goal
        if goal is not None:
            for neighbour in sorted(self._control.neighbours.ids()):
                heard = self._control.neighbours.place_of(neighbour)
                if heard is not None and heard.place.distance_m(goal) >= self._repair.range_m:
                    self._control.neighbour_leaves(neighbour)
        is_short = self._is_short()
        self._control.neighbours.takes_off(by_order=True)
        if not is_short:
            self._repair.on_ordered_flight()
            self._control.flies_far()

    def _is_short(self) -> bool:
        """Whether most neighbours will remain in reach, so that the router remains a relay."""
        if not self._states.connected or self._states.repair is RepairState.FLYING:
            return False
        return self._pilot.distance_m <= SHORT_FLIGHT * self._repair.range_m

    @due(Due.ASK_POSITION)
    def watch(self) -> None:
        if not self._pilot.watch():
            self._repair.on_flight_second()
        elif self._repair.on_arrived():
            self._landed()

    @due(Due.REPAIR)
    def on_repair_due(self) -> None:
        if self._repair.on_due():
            self._landed()

    def _landed(self) -> None:
        self._control.neighbours.stands(self._deadlines.now_s)
        if self._states.repair is RepairState.FLYING:
            self._repair.on_landed()
            super()._landed()
            return
        self._report(MeshEventKind.LANDED)
        self._orders.on_landed()
        if self._antenna.on():
            self._control.check(self._deadlines.now_s)
