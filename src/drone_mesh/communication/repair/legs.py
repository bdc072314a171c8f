"""LegByLeg: a repair that asks for places, flies a short leg, and asks again."""

from __future__ import annotations

import abc
import math
from typing import Iterable

from drone_mesh.communication.repair.interfaces import IRepairStrategy, NeighbourView, Step
from drone_mesh.drone.location import Location

LEG = 0.5  # of the range: distance between two requests for places
PAUSE_S = 2.0  # time to hear a gateway between two legs


class LegByLeg(IRepairStrategy):
    """What the literature describes as motion under continuous control, in legs.

    Only drones without a gateway fly, and each lands as soon as one answers.
    """

    _asked_s = -math.inf  # for the places of the neighbours

    @abc.abstractmethod
    def _goal(self, here: Location, gateway: Location) -> Location | None:
        """Where the next leg ends, at most LEG away; None: it stays, and sets `reason`."""

    def on_emergency(self) -> None:
        """Request the places of the neighbours, then move."""
        if self.mesh.now_s > self._asked_s + PAUSE_S:  # checks may follow each other faster
            self._ask()

    def on_landed(self) -> None:
        """Request places again, then move on."""
        self._ask()

    def _ask(self) -> None:
        self._asked_s = self.mesh.now_s
        self.mesh.ask_places()
        self.mesh.wait_until(self._asked_s + PAUSE_S)

    def on_time(self) -> None:
        """Fly one leg."""
        mesh, here, gateway = self.mesh, self.mesh.own_place(), self.mesh.gateway_place
        self.reason = mesh.why_not_fly()
        if gateway is None or here is None:
            self.reason = self.reason or "does not know where it is, or where the gateway is"
        if mesh.connected or self.reason or gateway is None or here is None:
            return
        goal = self._goal(here, gateway)
        if goal is not None:
            mesh.fly(Step(goal), until_connected=True)


DETOUR = 3.0  # times as many legs as the straight way to the gateway needs; chosen here
NEWS = 2.0  # ranges: farther away is no neighbour of a neighbour, whatever it says


class BoundedLegs(LegByLeg):
    """Legs that need not lead to the gateway, so their number is limited until one answers."""

    _legs_left: int | None = None  # None: it has not flown since it was connected

    @abc.abstractmethod
    def _next(self, here: Location, gateway: Location) -> Location | None:
        """As `_goal`."""

    def on_gateway_found(self) -> None:
        """The next loss starts over."""
        self._legs_left = None

    def _goal(self, here: Location, gateway: Location) -> Location | None:
        if self._legs_left is None:
            straight = here.distance_m(gateway) / (LEG * self.mesh.range_m)
            self._legs_left = math.ceil(DETOUR * (1.0 + straight))
        if self._legs_left == 0:
            self.reason = "flew to and fro without success"
            return None
        goal = self._next(here, gateway)
        if goal is not None:
            self._legs_left -= 1
        return goal

    def _near(self, here: Location, views: Iterable[NeighbourView]) -> list[Location]:
        """The places among these that can be those of neighbours, and of their neighbours."""
        news_m = NEWS * self.mesh.range_m
        places = [view.place for view in views if view.place is not None]
        return [place for place in places if here.distance_m(place) < news_m]
