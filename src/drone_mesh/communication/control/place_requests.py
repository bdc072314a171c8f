"""PlaceRequests: one node asks others for their places, and tells all in range its own.

A REQUESTLOCATION, which its addressee answers with a LOCATION.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from drone_mesh.communication.control.delivery import IDelivery
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.interfaces import BROADCAST, IWirelessCommunication
from drone_mesh.communication.timing.deadlines import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.drone.location import Location

SAME_PLACE_M = 0.09  # so much the spots of other drones allow for (TakenPlaces)


@dataclass(eq=False)
class PlaceRequests:
    """The requests of one node, which also tell where it is itself."""

    _node_id: int
    _pilot: Pilot
    _antenna: IWirelessCommunication
    _delivery: IDelivery
    _deadlines: Deadlines
    _told: Location | None = field(default=None, init=False)  # to all

    def ask(self, node: int) -> None:
        """Ask `node` for its place, along the route to it."""
        self._delivery.send_own(self._request(node))

    def ask_all(self, may_fly_on: bool = False) -> None:
        """Ask every node in range for its place; `may_fly_on`: and of others near, as in flight."""
        self._antenna.broadcast_message(self._request(BROADCAST, may_fly_on))

    def tell_all(self) -> None:
        """Tell every node in range where this one is or flies to: it may fall silent soon.

        Each place once: on a busy channel routers connect anew all the time.
        """
        goal = self._pilot.goal
        place = goal or self._pilot.location()
        if place is None or (self._told and self._told.distance_m(place) < SAME_PLACE_M):
            return
        self._told = place
        self._broadcast(place, is_goal=goal is not None)

    def announce(self, goal: Location) -> None:
        """Tell every node in range where this drone flies, or is about to fly."""
        self._broadcast(goal, is_goal=True)

    def _broadcast(self, place: Location, is_goal: bool) -> None:
        now_s = self._deadlines.now_s
        packet = messages.own_location(place, is_goal, now_s, self._node_id, BROADCAST)
        self._antenna.broadcast_message(packet)

    def _request(self, to: int, may_fly_on: bool = False) -> bytes:
        """A request with the place of this node: its destination, if it flies."""
        goal = self._pilot.goal
        place = goal or self._pilot.place()
        flies_there = may_fly_on or goal is not None
        return messages.request_for_place(self._node_id, to, place, flies_there=flies_there)
