"""Oracle: a repair that knows everything, which no drone can: the bound for all others."""

from __future__ import annotations

from typing import Callable, Mapping

from drone_mesh.communication.repair_interfaces import IRepairStrategy, Step
from drone_mesh.communication.spots import towards
from drone_mesh.drone.interfaces import Location

JUST_IN_RANGE = 0.95  # of the range


class Oracle(IRepairStrategy):
    """Flies into the range of the nearest node that is connected, wherever that is."""

    def __init__(self, connected: Callable[[], Mapping[int, Location]]) -> None:
        """`connected` gives the places of all connected nodes."""
        self._connected = connected

    def on_emergency(self) -> None:
        """Fly, unless another drone that flies now will be a relay."""
        mesh, here = self.mesh, self.mesh.own_place()
        self.reason = mesh.why_not_fly()
        places = self._connected()
        if self.reason or here is None or not places:
            return
        nearest = min(places, key=lambda node: (here.distance_m(places[node]), node))
        goal = towards(places[nearest], here, JUST_IN_RANGE * mesh.range_m)
        mesh.fly(Step(goal, nearest), until_connected=True)
