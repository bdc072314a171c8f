"""Claims: what other nodes say of their origin and of places, as far as this node can check it."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.neighbours.common_frame import CommonFrame
from drone_mesh.communication.neighbours.known_places import KnownPlaces
from drone_mesh.communication.timing.deadlines import Deadlines
from drone_mesh.drone.location import Location


@dataclass(eq=False)
class Claims:
    """Compares the claims of others with what one node knows; complains about impossible ones."""

    _frame: CommonFrame
    _places: KnownPlaces
    _complaints: Complaints
    _deadlines: Deadlines
    _range_m: float  # of the radio, as far as the node knows

    def heard_origin(self, neighbour: int, digest: int) -> None:
        """A neighbour tells the digest of its origin; complains if it is not this node's."""
        is_common, now_s = self._frame.heard(neighbour, digest), self._deadlines.now_s
        # The digest of a neighbour with a key, at a node without one, is part of a seal.
        if not is_common and not self._complaints.foreign_neighbour(now_s):
            self._complaints.add("a neighbour has another origin", f"node {neighbour}", now_s)

    def may_be_at(self, place: Location, gateway: bool, says_so: bool) -> bool:
        """Whether the gateway, or else the next hop, can be at `place`; counts it if not.

        `says_so`: that node itself says that it is there now. Complains if it goes on to do so.
        """
        now_s = self._deadlines.now_s
        possible = self._places.is_possible(place, self._range_m, gateway)
        is_wrong = says_so and self._places.is_still_wrong(gateway, not possible, now_s)
        if not possible:
            reason = f"a place where the {'gateway' if gateway else 'next hop'} cannot be"
            if is_wrong:
                self._complaints.add(reason, place.in_words(), now_s)
            else:
                self._complaints.counts[reason] += 1
        return possible
