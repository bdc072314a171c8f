"""Losses: how many beacons of each neighbour arrive, and what that costs on a way."""

from __future__ import annotations

from typing import NamedTuple

from drone_mesh.drone.location import Location

WEIGHT = 0.1  # of one beacon in the moving mean
LEAST = 0.05  # of the mean
STEP = 0.5  # hops: small differences must not change the parent
MOST = 3.0  # hops: of the loss of a link, whatever it loses
FAR = 0.15  # assumed of a link that is longer than it should reach, until it shows more
WRONG = 1.15  # of the range: a place further away errs, or fading adds to the power
LUCKY = 2.3  # of the range: fading that adds 10 dB reaches so far; from further away a place errs
STOOD = 0.05  # of the range: what both ends moved between two beacons, at most
FORGOTTEN = 20.0  # intervals: after such a silence a neighbour is a new one


class _Heard(NamedTuple):
    """The last beacon of one neighbour."""

    at_s: float
    interval_s: float
    own: Location
    place: Location


class Losses:
    """The share of beacons that pass on the links of one node, also of neighbours that fell silent.

    Otherwise a link that passes one beacon in ten would be new, and look perfect, each time. Only
    between drones that stand: what a link lost elsewhere says nothing.
    """

    def __init__(self, range_m: float) -> None:
        self._range_m = range_m
        self._kept: dict[int, float] = {}  # by neighbour
        self._heard: dict[int, _Heard] = {}

    def heard(
        self, node: int, interval_s: float, own: Location, place: Location, now_s: float
    ) -> float:
        """A beacon came; those that were due before it were lost. Returns the cost in hops."""
        before = self._heard.get(node)
        self._heard[node] = _Heard(now_s, interval_s, own, place)
        due = 1 if before is None else max(1, round((now_s - before.at_s) / before.interval_s))
        if due == 1 and self._kept.get(node) == 1.0:
            return 0.0  # wherever it is
        if due > FORGOTTEN:
            before = None
        is_far = WRONG < own.distance_m(place) / self._range_m <= LUCKY
        if before is not None and self._stood(before, own, place):
            kept = self._kept[node] * (1.0 - WEIGHT) ** due + WEIGHT
        elif not is_far:
            kept = 1.0
        else:  # one place may be wrong
            kept = FAR if before is None else self._kept[node]
        self._kept[node] = kept = max(LEAST, kept)
        again = 1.0 / kept - 1.0  # further frames, as expected: De Couto et al. 2003
        return min(MOST, again // STEP * STEP)

    def _stood(self, before: _Heard, own: Location, place: Location) -> bool:
        moved_m = own.distance_m(before.own) + place.distance_m(before.place)
        return moved_m <= STOOD * self._range_m
