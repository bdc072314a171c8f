"""TakenPlaces: where other drones stand, or may still hang in the air without a radio.

docs/repair.md, "Places of silent drones".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence

from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.repair.heights import above_ground
from drone_mesh.communication.repair.options import LostPlace, RepairOptions
from drone_mesh.communication.repair.spots import Landing, free_spot
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location

ROUNDING_M = 0.09  # a place in a beacon has tenths of a metre, on three axes
FRESH_S = 5.0  # with EXACT, a drone that was silent for longer takes no place


@dataclass(eq=False)
class TakenPlaces:
    """The places of other drones, as one node knows them, and the spots that are clear of them."""

    _node_id: int
    _deadlines: Deadlines
    _neighbours: Neighbours
    _places: KnownPlaces
    _options: RepairOptions

    def all(self) -> list[Location]:
        """Where each other node was last heard, and the gateway's place."""
        now_s, me = self._deadlines.now_s, self._node_id
        gateway = self._places.gateway  # it may be there, although it is off now
        kept_free = [] if gateway is None else [above_ground(gateway)]
        exact = self._options.lost_place is LostPlace.EXACT
        return kept_free + [
            above_ground(heard.place)
            for node, heard in self._neighbours.taken()
            if node != me and not (exact and now_s - heard.heard_s > FRESH_S)
        ]

    def is_free(self, spot: Location, tried: Sequence[Location] = ()) -> bool:
        """Whether the spot is clear of other drones, and of spots that were tried in vain."""
        clearance_m = self._options.clearance_m + ROUNDING_M
        return all(spot.distance_m(other) >= clearance_m for other in [*self.all(), *tried])

    def at_or_beside(
        self, place: Location, landing: Landing, tried: Sequence[Location] = ()
    ) -> Location:
        """`place` if that is free, else the best spot near it; none of those that it `tried`."""
        if self.is_free(place, tried):
            return place
        return free_spot(place, landing, self._options, [*self.all(), *tried])

    def beside(self, place: Location, landing: Landing, skip: int = 0) -> Location:
        """The best free spot near `place`; `skip`: see free_spot."""
        return free_spot(place, landing, self._options, self.all(), skip)
