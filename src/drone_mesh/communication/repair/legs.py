"""LegByLeg: a repair that asks for places, flies a short leg, and asks again."""

from __future__ import annotations

import abc
import math
from typing import Iterable

from drone_mesh.communication.repair.group_repair import IN_A_ROUND
from drone_mesh.communication.repair.interfaces import IRepairStrategy, NeighbourView, Step
from drone_mesh.communication.repair.nearest import Nearest
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

WAY = 1.5  # clearances beside a leg where another drone is in the way


class BoundedLegs(LegByLeg, Nearest):
    """Legs that need not lead to the gateway, so their number is limited until one answers.

    A drone that has come to rest without a gateway goes on as with `nearest`: its rule can be
    content where no link is, as beside a gateway that does not hear it.
    """

    _legs_left: int | None = None  # None: it has not flown since it was connected
    _rests = False  # by its rule, although no gateway answers
    _gives_way = False  # to another drone, for one pause

    @abc.abstractmethod
    def _next(self, here: Location, gateway: Location) -> Location | None:
        """As `_goal`."""

    def patience(self, silent: bool) -> float:
        """As for each of the two."""
        return (Nearest if self._rests else IRepairStrategy).patience(self, silent)

    def on_emergency(self) -> None:
        """Legs first."""
        (Nearest if self._rests else LegByLeg).on_emergency(self)

    def on_landed(self) -> None:
        """The next leg; or listen, as after a look around."""
        (Nearest if self._rests else LegByLeg).on_landed(self)

    def on_time(self) -> None:
        """Fly a leg, unless it rests, an election has begun, or another drone is in its way."""
        is_leg = not self._rests and self.mesh.state not in IN_A_ROUND
        self._gives_way = is_leg and not self._gives_way and self._is_behind()
        if self._gives_way:
            self._ask()
        else:
            (LegByLeg if is_leg else Nearest).on_time(self)

    def _is_behind(self) -> bool:
        """Whether another drone stands on its way to the gateway: that one flies first."""
        mesh, here, gateway = self.mesh, self.mesh.own_place(), self.mesh.gateway_place
        if here is None or gateway is None:
            return False
        ways = [here.towards(gateway, share * LEG * mesh.range_m) for share in (0.25, 0.5, 0.75, 1)]
        others = self._near(here, mesh.neighbours().values())
        return any(w.distance_m(o) < WAY * mesh.clearance_m for w in ways for o in others)

    def on_gateway_found(self) -> None:
        """The next loss starts over."""
        Nearest.on_gateway_found(self)
        self._legs_left, self._rests, self._gives_way = None, False, False

    def _goal(self, here: Location, gateway: Location) -> Location | None:
        if self._legs_left is None:
            straight = here.distance_m(gateway) / (LEG * self.mesh.range_m)
            self._legs_left = math.ceil(DETOUR * (1.0 + straight))
        goal = self._next(here, gateway) if self._legs_left else None
        if goal is None:
            self.reason = self.reason or "flew to and fro without success"
            self._rests = True
        else:
            self._legs_left -= 1
        return goal

    def _near(self, here: Location, views: Iterable[NeighbourView]) -> list[Location]:
        """The places among these that can be those of neighbours, and of their neighbours."""
        news_m = NEWS * self.mesh.range_m
        places = [view.place for view in views if view.place is not None]
        return [place for place in places if here.distance_m(place) < news_m]
