"""Oracle: a repair with global knowledge, which no drone can have: a bound for all others."""

from __future__ import annotations

from typing import Callable, Mapping

from drone_mesh.communication.repair.actions import Step
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.drone.location import Location

JUST_IN_RANGE = 0.95  # of the range


class Oracle(IRepairStrategy):
    """Flies into the range of the nearest connected node, wherever it is."""

    def __init__(self, connected: Callable[[], Mapping[int, Location]]) -> None:
        """`connected` returns the positions of all connected nodes."""
        self._connected = connected

    def on_emergency(self) -> None:
        """Fly, unless a drone in flight will become a relay."""
        mesh, here = self.mesh, self.mesh.own_place()
        self.reason = mesh.why_not_fly()
        places = self._connected()
        if self.reason or here is None or not places:
            return
        nearest = min(places, key=lambda node: (here.distance_m(places[node]), node))
        goal = places[nearest].towards(here, JUST_IN_RANGE * mesh.range_m)
        mesh.fly(Step(goal, nearest), until_connected=True)
