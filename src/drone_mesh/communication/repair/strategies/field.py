"""Field: each drone moves a little towards its neighbours, and a lot towards the gateway.

After MDSG-APF (Mou et al.) and HERO (Mi, Yang, Liu, ICRA 2011), reduced to what a node knows of its
neighbours, with the gateway's place as the centre of the field.
"""

from __future__ import annotations

import math

from drone_mesh.communication.repair.actions import Step
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.drone.location import Location

TO_NEIGHBOURS = 0.1  # weight of the neighbours against the gateway, as in MDSG-APF
LEG = 0.5  # of the range: distance between two requests for places
PAUSE_S = 2.0  # time to hear a gateway between two legs


class Field(IRepairStrategy):
    """Flies leg by leg, until a gateway answers or the gateway's place is reached."""

    _nearest_m = math.inf  # to the gateway's place, since the connection was lost
    _asked_s = -math.inf  # for the places of the neighbours

    def on_gateway_found(self) -> None:
        """Forget the distance reached: the next loss starts over."""
        self._nearest_m = math.inf

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
        views = mesh.neighbours().values()
        places = [view.place for view in views if view.place is not None] or [here]
        middle = Location(*(sum(axis) / len(places) for axis in zip(*places)))
        goal = gateway.towards(middle, TO_NEIGHBOURS * gateway.distance_m(middle))
        leg_m = min(LEG * mesh.range_m, here.distance_m(goal))
        away_m = here.distance_m(gateway)
        if away_m > self._nearest_m - mesh.clearance_m:
            self.reason = "came no nearer to the gateway"
        else:
            self._nearest_m = away_m
            mesh.fly(Step(here.towards(goal, leg_m)), until_connected=True)
