"""How near drones came to each other while repairs flew them: on the way, and where they ended.

Flights are straight lines at constant speed, so the nearest moment of two drones is known exactly.
"""

from __future__ import annotations

import itertools
import math
from typing import Iterator, NamedTuple, Sequence

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.flight_path import CLIMB_ENDS_AT, DESCENT_STARTS_AT, between
from drone_mesh.lab.flights import Leg
from drone_mesh.lab.record import Place, RunRecord

_FLIGHTS = (MeshEventKind.FLIGHT_DECIDED.value, MeshEventKind.FLIGHT_ORDERED.value)


class Approach(NamedTuple):
    """The nearest moment of a drone on a flight of a repair and another one."""

    flier: int
    other: int
    metres: float
    at_s: float
    in_the_air: bool  # both flew; otherwise the other one was at rest


class _Piece(NamedTuple):
    """A drone at rest, or on one straight line."""

    start_s: float
    end_s: float
    start: Place
    end: Place
    is_repair: bool


def approaches(run: RunRecord, within_m: float) -> list[Approach]:
    """The nearest moments of each pair that came nearer than this, radios on or off.

    One while the other drone was at rest, and one while both flew.
    """
    ways = {node: list(_way(run, node, place)) for node, place in run.start.places.items()}
    nearest: dict[tuple[int, int, bool], Approach] = {}
    for flier, other in itertools.permutations(ways, 2):
        for piece, others in itertools.product(ways[flier], ways[other]):
            if not piece.is_repair or not _overlap(piece, others):
                continue
            found = Approach(flier, other, *_moment(piece, others), others.start != others.end)
            pair = (min(flier, other), max(flier, other), found.in_the_air)
            before_m = nearest[pair].metres if pair in nearest else within_m
            if found.metres < before_m:
                nearest[pair] = found
    return list(nearest.values())


def _way(run: RunRecord, node: int, place: Place) -> Iterator[_Piece]:
    now_s = 0.0
    for leg in run.legs:
        if leg.node != node:
            continue
        yield _Piece(now_s, leg.path.start_s, place, place, False)
        yield from _pieces(leg, _is_repair(run, leg))
        now_s, place = leg.end_s, leg.path.position_at(leg.end_s)
    yield _Piece(now_s, max(now_s, run.end_s), place, place, False)


def _is_repair(run: RunRecord, leg: Leg) -> bool:
    """Whether the drone's latest flight until then was decided on, and not ordered."""
    begun = [
        event.kind == MeshEventKind.FLIGHT_DECIDED.value
        for event in run.events
        if event.node == leg.node and event.kind in _FLIGHTS and event.stamp_s <= leg.path.start_s
    ]
    return begun != [] and begun[-1]


def _pieces(leg: Leg, is_repair: bool) -> Iterator[_Piece]:
    path = leg.path
    shares = [0.0, CLIMB_ENDS_AT, DESCENT_STARTS_AT, 1.0]
    if path.around:  # its corners on the way across are between short lines
        shares[2:2] = [CLIMB_ENDS_AT + n / 100.0 for n in range(1, 80)]
    times = [path.start_s + share * path.duration_s for share in shares]
    for start_s, planned_s in zip(times, times[1:]):
        end_s = min(planned_s, leg.end_s)
        if start_s < end_s:
            ends = path.position_at(start_s), path.position_at(end_s)
            yield _Piece(start_s, end_s, *ends, is_repair)


def _overlap(piece: _Piece, other: _Piece) -> bool:
    return max(piece.start_s, other.start_s) <= min(piece.end_s, other.end_s)


def _moment(piece: _Piece, other: _Piece) -> tuple[float, float]:
    """Metres and time of the nearest moment of two pieces that overlap in time."""
    start_s, end_s = max(piece.start_s, other.start_s), min(piece.end_s, other.end_s)
    apart = _apart(piece, other, start_s), _apart(piece, other, end_s)
    share = _nearest_share(*apart)
    return math.hypot(*between(*apart, share)), start_s + share * (end_s - start_s)


def _apart(one: _Piece, other: _Piece, now_s: float) -> Place:
    here, there = _at(one, now_s), _at(other, now_s)
    return (here[0] - there[0], here[1] - there[1], here[2] - there[2])


def _at(piece: _Piece, now_s: float) -> Place:
    length_s = piece.end_s - piece.start_s
    return between(piece.start, piece.end, (now_s - piece.start_s) / length_s if length_s else 1.0)


def _nearest_share(start: Sequence[float], end: Sequence[float]) -> float:
    """How far along this line the point nearest to the origin lies, 0 to 1."""
    way = [b - a for a, b in zip(start, end)]
    length_2 = sum(step * step for step in way)
    if length_2 == 0.0:
        return 0.0
    return min(1.0, max(0.0, -sum(a * step for a, step in zip(start, way)) / length_2))
