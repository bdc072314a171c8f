"""Metrics of what a repair must never do, and of what it leaves undone."""

from __future__ import annotations

import itertools
import math
from typing import Iterator, NamedTuple

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.repair.options import CLEARANCE_M
from drone_mesh.drone.flight_path import (
    CLIMB_ENDS_AT,
    DESCENT_STARTS_AT,
    between,
    nearest_share,
)
from drone_mesh.lab.flights import Leg
from drone_mesh.lab.metrics.registry import NAN, less, metric, metrics, more
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
    in_flight: bool
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
            found = Approach(flier, other, *_moment(piece, others), others.in_flight)
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
        if now_s < leg.path.start_s:  # it did not only turn in the air
            yield _Piece(now_s, leg.path.start_s, place, place, False, False)
        yield from _pieces(leg, _is_repair(run, leg))
        now_s, place = leg.end_s, leg.path.position_at(leg.end_s)
    yield _Piece(now_s, max(now_s, run.end_s), place, place, False, False)


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
            yield _Piece(start_s, end_s, *ends, True, is_repair)


def _overlap(piece: _Piece, other: _Piece) -> bool:
    return max(piece.start_s, other.start_s) <= min(piece.end_s, other.end_s)


def _moment(piece: _Piece, other: _Piece) -> tuple[float, float]:
    """Metres and time of the nearest moment of two pieces that overlap in time."""
    start_s, end_s = max(piece.start_s, other.start_s), min(piece.end_s, other.end_s)
    apart = _apart(piece, other, start_s), _apart(piece, other, end_s)
    share = nearest_share(*apart)
    return math.hypot(*between(*apart, share)), start_s + share * (end_s - start_s)


def _apart(one: _Piece, other: _Piece, now_s: float) -> Place:
    here, there = _at(one, now_s), _at(other, now_s)
    return (here[0] - there[0], here[1] - there[1], here[2] - there[2])


def _at(piece: _Piece, now_s: float) -> Place:
    length_s = piece.end_s - piece.start_s
    return between(piece.start, piece.end, (now_s - piece.start_s) / length_s if length_s else 1.0)


TOO_CLOSE_M = CLEARANCE_M - 1e-6  # for rounding
PROMPT_S = 120.0  # a node that is cut off should be connected again by then


@less(
    "0/1",
    "any of resting_close, flew_close, flew_connected, flew_grounded, left_able, left_placeless "
    "and endless_packets is above 0",
)
def harm(run: RunRecord) -> float:
    counts = (resting_close, left_able, left_placeless)
    return close_ones(run)[0] > 0 or any(count(run) > 0 for count in counts) or _is_wrong(run)


@less(
    "0/1",
    "harm that nodes could avoid: in resting_close, flew_close, left_able and left_placeless only "
    "places that a live node knew whom the drone could ask: itself, or one to which links led",
)
def avoidable_harm(run: RunRecord) -> float:
    warned = {
        frozenset((leg.node, other))
        for leg in run.legs
        if leg.warned_of and _is_repair(run, leg)
        for other in leg.warned_of
    }
    close, resting = set(), set(_resting_close(run))
    if (warned or resting) and run.scenario.mobility.kind == "none":
        close = {frozenset(it[:2]) for it in approaches(run, TOO_CLOSE_M) if not it.in_the_air}
    near = close & warned or resting - (close - warned)
    placeless = _placeless(run) & run.end.graph.hops_from(run.informed).keys()
    return bool(near or placeless or run.left_behind.keys() & run.able_knowing) or _is_wrong(run)


def _is_wrong(run: RunRecord) -> bool:
    """Whether there is harm of a kind that no knowledge of places excuses."""
    counts = (flew_connected, flew_grounded, endless_packets)
    return any(count(run) > 0 for count in counts)


@less("", "pairs of drones at rest, on or off, nearer than the clearance, 1 m, at the end")
def resting_close(run: RunRecord) -> float:
    return len(_resting_close(run))


def _resting_close(run: RunRecord) -> list[frozenset[int]]:
    places, at_rest = run.end.places, sorted(run.end.places.keys() - run.in_the_air)
    pairs = itertools.combinations(at_rest, 2)
    return [frozenset(it) for it in pairs if math.dist(places[it[0]], places[it[1]]) < TOO_CLOSE_M]


@metrics(
    "",
    "less",
    flew_close="drones at rest, on or off, to which another one came nearer than the clearance, "
    "1 m, on a flight for a repair or where a part of it ended; empty: pilots fly drones",
    passed_close="pairs of drones in flight, one for a repair, that came nearer than 1 m",
)
def close_ones(run: RunRecord) -> tuple[float, float]:
    if run.scenario.mobility.kind != "none":
        return NAN, NAN
    found = approaches(run, TOO_CLOSE_M)
    passed = sum(approach.in_the_air for approach in found)
    return len(found) - passed, passed


@less("s", "all drones together were outside the fence, on flights of the mesh and at rest")
def outside_s(run: RunRecord) -> float:
    fence = run.scenario.fence.fence()
    if not fence:
        return 0.0
    ways = (_way(run, node, place) for node, place in run.start.places.items())
    return sum(
        (piece.end_s - piece.start_s) * fence.outside_share(piece.start, piece.end)
        for piece in itertools.chain.from_iterable(ways)
    )


@less("", "repair flights of drones that were connected")
def flew_connected(run: RunRecord) -> float:
    connected: set[int] = set()
    flights = 0
    for event in run.events:
        if event.kind == MeshEventKind.CONNECTED.value:
            connected.add(event.node)
        elif event.kind in (MeshEventKind.DISCONNECTED.value, MeshEventKind.STARTED.value):
            connected.discard(event.node)
        elif event.kind == MeshEventKind.FLIGHT_DECIDED.value:
            flights += event.node in connected
    return flights


@less("", "repair flights of drones that cannot fly")
def flew_grounded(run: RunRecord) -> float:
    return sum(node in run.grounded for node in _nodes_with(run, MeshEventKind.FLIGHT_DECIDED))


@less("", "flights that repairs decided on")
def repair_flights(run: RunRecord) -> float:
    return len(_nodes_with(run, MeshEventKind.FLIGHT_DECIDED))


def _nodes_with(run: RunRecord, kind: MeshEventKind) -> list[int]:
    """The node of each event of this kind."""
    return [event.node for event in run.events if event.kind == kind.value]


@less("drones", "live routers that are not connected at the end")
def left_behind(run: RunRecord) -> float:
    return len(run.left_behind)


@less("drones", "the ones that can fly, have a link left and know a gateway")
def left_able(run: RunRecord) -> float:
    return len(run.left_behind.keys() & run.able)


@less(
    "drones",
    "of left_behind: those that know no place, although they, or others that they reach, "
    "were connected since they started",
)
def left_placeless(run: RunRecord) -> float:
    return len(_placeless(run))


def _placeless(run: RunRecord) -> set[int]:
    informed: set[int] = set()
    for event in run.events:
        if event.kind == MeshEventKind.CONNECTED.value:
            informed.add(event.node)
        elif event.kind == MeshEventKind.STARTED.value:
            informed.discard(event.node)  # a restarted node has forgotten
    told = run.end.graph.hops_from(informed)
    return {n for n, why in run.left_behind.items() if n in told and "knows no place" in why}


@less("", "packets that were dropped at the limit of hops")
def endless_packets(run: RunRecord) -> float:
    return run.endless_packets


@metric("", "times that a fault left a live router without any path to a gateway, while one was on")
def times_cut_off(run: RunRecord) -> float:
    return len(run.cut_offs)


@more("", "of times_cut_off: served again within 120 s")
def times_back(run: RunRecord) -> float:
    return sum(
        gap.restored_s is not None and gap.restored_s - gap.lost_s <= PROMPT_S
        for gap in run.cut_offs
    )
