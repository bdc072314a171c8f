"""SeenMotion: whether pilots, missions or the wind move this node or those around it."""

from __future__ import annotations

import math
from typing import NamedTuple

from drone_mesh.drone.location import Location

STEP = 0.1  # of the range: positions of satellites err by far less
REPORTS = 3.0  # one may be lost
FLIGHT_S = 10.0  # a repair flight asks for places each second, and some are lost


class _Track(NamedTuple):
    """What one node's reports show."""

    place: Location  # from where its next step counts
    before: Location | None = None  # its last step
    stepped_s: float = -math.inf
    moves_s: float = -math.inf  # when it was last at a third place


class SeenMotion:
    """Tells motion from flights for the mesh by the places that the nodes report.

    A flight for the mesh is reported with its goal, so it is one step from one place to another. A
    node that takes a second one within `within_s`, to a third place, moves by itself.
    """

    def __init__(self, range_m: float, asked_s: float) -> None:
        """`asked_s`: a connected router asks its next hop for its place so often."""
        self._step_m = STEP * range_m
        self.within_s = REPORTS * asked_s
        self._tracks: dict[int, _Track] = {}
        self._flew_s: dict[int, float] = {}  # for a repair

    def reported(self, node: int, place: Location, now_s: float) -> None:
        """`node` is at `place`, or flies there."""
        track = self._tracks.get(node)
        if track is None or now_s - self._flew_s.get(node, -math.inf) < FLIGHT_S:
            self._tracks[node] = _Track(place)
            return
        step_m = self._step_m
        if place.distance_m(track.place) <= step_m:
            return
        is_third = track.before is not None and place.distance_m(track.before) > step_m
        moves = is_third and now_s - track.stepped_s <= self.within_s
        moves_s = now_s if moves else track.moves_s
        self._tracks[node] = _Track(place, track.place, now_s, moves_s)

    def flies_for_repair(self, node: int, now_s: float) -> None:
        """`node` asks for places on its flight."""
        self._flew_s[node] = now_s

    def forget(self, node: int) -> None:
        """`node` flies for the mesh from where it was."""
        self._tracks.pop(node, None)

    def moved_since(self, since_s: float) -> bool:
        """Whether any node was seen to move by itself since then."""
        return any(track.moves_s >= since_s for track in self._tracks.values())
