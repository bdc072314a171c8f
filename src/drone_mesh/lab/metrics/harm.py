"""Metrics of what a repair must never do, and of what it leaves undone."""

from __future__ import annotations

import itertools
import math

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.repair.options import CLEARANCE_M
from drone_mesh.lab.approaches import approaches
from drone_mesh.lab.metrics.registry import NAN, metric, metrics
from drone_mesh.lab.record import RunRecord

ROUNDING_M = 1e-6
PROMPT_S = 120.0  # a node that is cut off should be connected again by then


@metric(
    "0/1",
    "any of resting_close, flew_close, flew_connected, flew_grounded, left_able, left_placeless "
    "and endless_packets is above 0",
    better="less", is_share=True,
)  # fmt: skip
def harm(run: RunRecord) -> float:
    kinds = (
        resting_close,
        flew_connected,
        flew_grounded,
        left_able,
        left_placeless,
        endless_packets,
    )
    return close_ones(run)[0] > 0 or any(count(run) > 0 for count in kinds)


@metric(
    "", "pairs of drones at rest, on or off, nearer than the clearance, 1 m, at the end",
    better="less",
)  # fmt: skip
def resting_close(run: RunRecord) -> float:
    at_rest = sorted(run.end.places.keys() - run.in_the_air)
    return sum(
        math.dist(run.end.places[one], run.end.places[other]) < CLEARANCE_M - ROUNDING_M
        for one, other in itertools.combinations(at_rest, 2)
    )


@metrics(
    "",
    better="less",
    flew_close="drones at rest, on or off, to which another one came nearer than the clearance, "
    "1 m, on a flight for a repair or where a part of it ended; empty: pilots fly drones",
    passed_close="pairs of drones in flight, one for a repair, that came nearer than 1 m",
)
def close_ones(run: RunRecord) -> tuple[float, float]:
    if run.scenario.mobility.kind != "none":
        return NAN, NAN
    found = approaches(run, CLEARANCE_M - ROUNDING_M)
    passed = sum(approach.in_the_air for approach in found)
    return len(found) - passed, passed


@metric("", "repair flights of drones that were connected", better="less")
def flew_connected(run: RunRecord) -> float:
    connected: set[int] = set()
    flights = 0
    for event in run.events:
        if event.kind == MeshEventKind.CONNECTED.value:
            connected.add(event.node)
        elif event.kind == MeshEventKind.DISCONNECTED.value:
            connected.discard(event.node)
        elif event.kind == MeshEventKind.FLIGHT_DECIDED.value:
            flights += event.node in connected
    return flights


@metric("", "repair flights of drones that cannot fly", better="less")
def flew_grounded(run: RunRecord) -> float:
    return sum(node in run.grounded for node in _nodes_with(run, MeshEventKind.FLIGHT_DECIDED))


@metric("", "flights that repairs decided on", better="less")
def repair_flights(run: RunRecord) -> float:
    return len(_nodes_with(run, MeshEventKind.FLIGHT_DECIDED))


def _nodes_with(run: RunRecord, kind: MeshEventKind) -> list[int]:
    """The node of each event of this kind."""
    return [event.node for event in run.events if event.kind == kind.value]


@metric("drones", "live routers that are not connected at the end", better="less")
def left_behind(run: RunRecord) -> float:
    return len(run.left_behind)


@metric("drones", "the ones that can fly, have a link left and know a gateway", better="less")
def left_able(run: RunRecord) -> float:
    return len(run.left_behind.keys() & run.able)


@metric(
    "drones", "of left_behind: those that know no place, although they, or others that they reach, "
    "were connected since they started", better="less",
)  # fmt: skip
def left_placeless(run: RunRecord) -> float:
    informed: set[int] = set()
    for event in run.events:
        if event.kind == MeshEventKind.CONNECTED.value:
            informed.add(event.node)
        elif event.kind == MeshEventKind.STARTED.value:
            informed.discard(event.node)  # a restarted node has forgotten
    told = run.end.graph.hops_from(informed)
    return sum(node in told and "knows no place" in why for node, why in run.left_behind.items())


@metric("", "packets that were dropped at the limit of hops", better="less")
def endless_packets(run: RunRecord) -> float:
    return run.endless_packets


@metric("", "times that a fault left a live router without any path to a gateway, while one was on")
def times_cut_off(run: RunRecord) -> float:
    return len(run.cut_offs)


@metric("", "of times_cut_off: served again within 120 s", better="more")
def times_back(run: RunRecord) -> float:
    return sum(
        gap.restored_s is not None and gap.restored_s - gap.lost_s <= PROMPT_S
        for gap in run.cut_offs
    )
