"""The metrics of a run: one column each, with unit and definition."""

from __future__ import annotations

import math
import statistics
from typing import Callable, NamedTuple, Sequence

import numpy as np

from drone_mesh.communication.messages import MessageType
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.lab.graph import Graph
from drone_mesh.lab.record import RunRecord, Scene

STACKED_M = 0.3  # nearer than this two drones stand on one another
DELIVERED_WITHIN_S = 10.0  # an order that comes later counts as lost
NAN = math.nan


class Metric(NamedTuple):
    """One column of runs.csv."""

    unit: str
    definition: str
    measure: Callable[[RunRecord], float]  # NaN: not defined for this run, an empty cell
    better: str = ""  # "less", "more" or neither
    is_share: bool = False  # every run yields 0 or 1
    censored: bool = False  # a time that is empty where the run did not get there


METRICS: dict[str, Metric] = {}


def measure_all(record: RunRecord) -> dict[str, float]:
    """Every metric of a run, by name."""
    return {name: metric.measure(record) for name, metric in METRICS.items()}


def _metric(
    unit: str, definition: str, **about: object
) -> Callable[[Callable[[RunRecord], float]], Callable[[RunRecord], float]]:
    def note(measure: Callable[[RunRecord], float]) -> Callable[[RunRecord], float]:
        METRICS[measure.__name__] = Metric(unit, definition, measure, **about)  # type: ignore[arg-type]
        return measure

    return note


# Healing ---------------------------------------------------------------------------------------


@_metric("0/1", "all live routers are served again before the end", better="more", is_share=True)
def healed(run: RunRecord) -> float:
    return float(run.healed_at_s is not None)


@_metric("0/1", "the fault left a live router without any path to a gateway", is_share=True)
def split(run: RunRecord) -> float:
    return NAN if run.after_fault is None else float(cut_off(run) > 0)


@_metric("drones", "live routers without any path to a gateway right after the fault")
def cut_off(run: RunRecord) -> float:
    if run.after_fault is None:
        return NAN
    return float(len(run.after_fault.near) - len(run.after_fault.hops_from(sorted(run.gateways))))


@_metric("drones", "drones that faults switched off during the run")
def victims(run: RunRecord) -> float:
    deadly = ("kill", "gateway_off", "battery empty", "death")
    return float(len({n for item in run.happened if item.action in deadly for n in item.nodes}))


@_metric(
    "s", "from the fault until all live routers are served for 5 s; empty: not healed",
    better="less", censored=True,
)  # fmt: skip
def t_total_s(run: RunRecord) -> float:
    if run.healed_at_s is None or run.fault_s is None:
        return NAN
    return run.healed_at_s - run.fault_s


@_metric("s", "t_total_s, or observed_s if not healed; only for tables that average caps in")
def t_capped_s(run: RunRecord) -> float:
    total_s = t_total_s(run)
    return observed_s(run) if math.isnan(total_s) else total_s


@_metric("s", "of t_total_s: until the first router notices that it has lost its gateway")
def t_detect_s(run: RunRecord) -> float:
    return _phases(run)[0]


@_metric("s", "of t_total_s: from there until the first drone decides to fly; 0 without flight")
def t_decide_s(run: RunRecord) -> float:
    return _phases(run)[1]


@_metric("s", "of t_total_s: from there until the last landing; 0 without flight")
def t_fly_s(run: RunRecord) -> float:
    return _phases(run)[2]


@_metric("s", "of t_total_s: the rest")
def t_reroute_s(run: RunRecord) -> float:
    return _phases(run)[3]


@_metric("s", "from the fault to the end of the run: where an unhealed run is censored")
def observed_s(run: RunRecord) -> float:
    return NAN if run.fault_s is None else run.end_s - run.fault_s


@_metric("s", "from the start until all routers are served for the first time", better="less")
def connected_s(run: RunRecord) -> float:
    return next((look.now_s for look in run.looks if look.share == 1.0), NAN)


@_metric("share", "live routers that are served at the end", better="more")
def connected_share(run: RunRecord) -> float:
    return run.looks[-1].share


@_metric("share", "served routers, mean over the time since the fault", better="more")
def uptime(run: RunRecord) -> float:
    begin_s = 0.0 if run.fault_s is None else run.fault_s
    looks = [look for look in run.looks if look.now_s >= begin_s]
    area = sum(
        (after.now_s - before.now_s) * (before.share + after.share) / 2
        for before, after in zip(looks, looks[1:])
    )
    seconds = looks[-1].now_s - looks[0].now_s
    return area / seconds if seconds else looks[-1].share


def _phases(run: RunRecord) -> tuple[float, float, float, float]:
    """(detect, decide, fly, re-route) in seconds; they add up to t_total_s."""
    start_s, end_s = run.fault_s, run.healed_at_s
    if start_s is None or end_s is None:
        return (NAN, NAN, NAN, NAN)
    between = [event for event in run.events if start_s <= event.stamp_s <= end_s]
    if start_s == end_s:
        return (0.0, 0.0, 0.0, 0.0)
    noticed = _first(between, MeshEventKind.DISCONNECTED)
    decided = _first(between, MeshEventKind.FLIGHT_DECIDED)
    landings = [event.stamp_s for event in between if event.kind == MeshEventKind.LANDED.value]
    decided_s = end_s if decided is None else decided
    noticed_s = min(decided_s, end_s if noticed is None else noticed)
    if decided is None:
        return (noticed_s - start_s, 0.0, 0.0, end_s - noticed_s)
    landed_s = max([decided_s, *landings])
    return (noticed_s - start_s, decided_s - noticed_s, landed_s - decided_s, end_s - landed_s)


def _first(events: Sequence[object], kind: MeshEventKind) -> float | None:
    return next(
        (event.stamp_s for event in events if event.kind == kind.value),  # type: ignore[attr-defined]
        None,
    )


# Outages of single routers ---------------------------------------------------------------------


@_metric("", "times that a live router was without service since the fault", better="less")
def outages(run: RunRecord) -> float:
    return float(len(run.gaps()))


@_metric("s", "median length of these outages; one that lasts counts up to the end", better="less")
def outage_median_s(run: RunRecord) -> float:
    lengths = _outage_lengths(run)
    return statistics.median(lengths) if lengths else 0.0


@_metric("s", "95th percentile of their lengths", better="less")
def outage_p95_s(run: RunRecord) -> float:
    lengths = _outage_lengths(run)
    return lengths[math.ceil(0.95 * len(lengths)) - 1] if lengths else 0.0


@_metric("s", "the longest of them", better="less")
def outage_max_s(run: RunRecord) -> float:
    return max(_outage_lengths(run), default=0.0)


def _outage_lengths(run: RunRecord) -> list[float]:
    return sorted(gap.seconds(run.end_s) for gap in run.gaps())


# Movement --------------------------------------------------------------------------------------


def _flown(run: RunRecord) -> dict[int, float]:
    metres: dict[int, float] = {}
    for leg in run.legs:
        metres[leg.node] = metres.get(leg.node, 0.0) + leg.metres_until(run.end_s)
    return metres


@_metric("m", "distance over ground flown by all drones", better="less")
def distance_total_m(run: RunRecord) -> float:
    return sum(_flown(run).values())


@_metric("m", "the longest distance that one drone flew", better="less")
def distance_max_m(run: RunRecord) -> float:
    return max(_flown(run).values(), default=0.0)


@_metric("m", "mean distance of the drones that moved; 0 when none did", better="less")
def distance_mean_m(run: RunRecord) -> float:
    flown = _flown(run)
    return sum(flown.values()) / len(flown) if flown else 0.0


@_metric("drones", "drones that flew", better="less")
def moved(run: RunRecord) -> float:
    return float(len(_flown(run)))


@_metric("", "take-offs", better="less")
def flights(run: RunRecord) -> float:
    return float(sum(leg.is_start for leg in run.legs))


@_metric("", "flights that a router decided on although it had a path to a gateway", better="less")
def false_flights(run: RunRecord) -> float:
    return float(sum(leg.had_path for leg in run.legs))


@_metric("s", "time in flight of all drones", better="less")
def flight_time_s(run: RunRecord) -> float:
    return sum(min(leg.end_s, run.end_s) - leg.path.start_s for leg in run.legs)


@_metric("m", "mean distance of a live drone from where it started", better="less")
def displacement_mean_m(run: RunRecord) -> float:
    moved_m = _displacements(run)
    return sum(moved_m) / len(moved_m) if moved_m else 0.0


@_metric("m", "the largest of these", better="less")
def displacement_max_m(run: RunRecord) -> float:
    return max(_displacements(run), default=0.0)


def _displacements(run: RunRecord) -> list[float]:
    return [
        math.dist(run.start.places[node][:2], run.end.places[node][:2])
        for node in sorted(run.end.graph.near)
    ]


@_metric(
    "", "pairs of live drones nearer than 0.3 m at some time, one of them in flight", better="less"
)
def collisions(run: RunRecord) -> float:
    return float(run.collisions)


@_metric("m", "smallest distance of a drone in flight to another; empty: no flight", better="more")
def min_distance_m(run: RunRecord) -> float:
    return run.min_distance_m if math.isfinite(run.min_distance_m) else NAN


@_metric(
    "drones", "live drones within 0.3 m of another at the end, and not at the start", better="less"
)
def stacked(run: RunRecord) -> float:
    return float(len(_stacked(run.end, run.end.graph) - _stacked(run.start, run.end.graph)))


def _stacked(scene: Scene, alive: Graph) -> set[int]:
    nodes = sorted(alive.near)
    points = np.array([scene.places[node] for node in nodes])
    if len(nodes) < 2:
        return set()
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < STACKED_M
    np.fill_diagonal(near, False)
    return {nodes[index] for index in np.flatnonzero(near.any(axis=1))}


@_metric("", "flights that an obstacle did not allow", better="less")
def flights_blocked(run: RunRecord) -> float:
    return float(run.refused_flights)


# Shape -----------------------------------------------------------------------------------------


@_metric("parts", "connected parts right before the fault (or at the start)")
def parts_before(run: RunRecord) -> float:
    return float(len(_before(run).graph.parts()))


@_metric("parts", "connected parts at the end", better="less")
def parts_after(run: RunRecord) -> float:
    return float(len(run.end.graph.parts()))


@_metric("hops", "mean length of the routes in use right before the fault")
def hops_mean_before(run: RunRecord) -> float:
    return _mean(_before(run).route_hops.values())


@_metric("hops", "mean length of the routes in use at the end", better="less")
def hops_mean_after(run: RunRecord) -> float:
    return _mean(run.end.route_hops.values())


@_metric("hops", "longest route in use right before the fault")
def hops_max_before(run: RunRecord) -> float:
    return float(max(_before(run).route_hops.values(), default=0))


@_metric("hops", "longest route in use at the end", better="less")
def hops_max_after(run: RunRecord) -> float:
    return float(max(run.end.route_hops.values(), default=0))


@_metric(
    "ratio", "route in use by shortest path, mean of the served routers at the end", better="less"
)
def stretch(run: RunRecord) -> float:
    shortest = run.end.graph.hops_from(sorted(run.gateways))
    return _mean(
        hops / shortest[node] for node, hops in run.end.route_hops.items() if shortest.get(node)
    )


@_metric("neighbours", "mean number of drones in range of a live drone at the end")
def degree_after(run: RunRecord) -> float:
    return run.end.graph.mean_degree()


@_metric(
    "share", "ground within range of a drone at the end, by that before the fault", better="more"
)
def coverage(run: RunRecord) -> float:
    before = _before(run)
    range_m = run.scenario.range_m
    points_before = [before.places[n][:2] for n in sorted(before.graph.near)]
    points_after = [run.end.places[n][:2] for n in sorted(run.end.graph.near)]
    if not points_before or not points_after:
        return 0.0
    return covered(points_after, range_m) / covered(points_before, range_m)


def covered(points: Sequence[Sequence[float]], range_m: float) -> int:
    """Cells of a grid, an eighth of the range wide, whose middle a drone reaches."""
    cell = range_m / 8
    offsets = np.arange(-8, 9)
    dx, dy = np.meshgrid(offsets, offsets)
    corners = np.floor(np.asarray(points) / cell).astype(np.int64)
    cells = corners[:, None, :] + np.stack([dx.ravel(), dy.ravel()], axis=1)[None]
    middles = (cells + 0.5) * cell
    inside = ((middles - np.asarray(points)[:, None, :]) ** 2).sum(axis=2) < range_m**2
    reached = cells[inside]
    return len(np.unique(reached[:, 0] * 10_000_019 + reached[:, 1]))


def _before(run: RunRecord) -> Scene:
    return run.start if run.before is None else run.before


def _mean(values: object) -> float:
    found = list(values)  # type: ignore[call-overload]
    return sum(found) / len(found) if found else NAN


# Traffic ---------------------------------------------------------------------------------------


@_metric(
    "packets",
    "packets handed to the radio; on the disc all tries, broadcasts once per receiver",
    better="less",
)
def packets(run: RunRecord) -> float:
    return float(sum(one.own + one.forwarded for one in run.traffic.values()))


@_metric("1/s", "packets per drone and second", better="less")
def packet_rate(run: RunRecord) -> float:
    return packets(run) / run.end_s / len(run.start.places)


@_metric("bytes", "32 bytes for each of these packets", better="less")
def payload_bytes(run: RunRecord) -> float:
    return 32.0 * packets(run)


@_metric("share", "time with frames on the air, those at one time added; shared radio only")
def air_load(run: RunRecord) -> float:
    return NAN if run.airtime_s is None else run.airtime_s / run.end_s


@_metric("frames", "receptions that another frame destroyed; shared radio only", better="less")
def frames_destroyed(run: RunRecord) -> float:
    return NAN if run.frames_destroyed is None else float(run.frames_destroyed)


@_metric("", "flight orders that were given")
def orders(run: RunRecord) -> float:
    return float(len(run.orders))


@_metric("share", "orders whose drone set out within 10 s; empty: no orders", better="more")
def order_delivery(run: RunRecord) -> float:
    return sum(d is not None for d in _order_delays(run)) / len(run.orders) if run.orders else NAN


@_metric("ms", "median time from an order to its drone's departure", better="less")
def order_delay_ms(run: RunRecord) -> float:
    delays = [delay for delay in _order_delays(run) if delay is not None]
    return 1000.0 * statistics.median(delays) if delays else NAN


def _order_delays(run: RunRecord) -> list[float | None]:
    departures: dict[int, list[float]] = {}
    for event in run.events:
        if event.kind == MeshEventKind.FLIGHT_ORDERED.value:
            departures.setdefault(event.node, []).append(event.stamp_s)
    return [
        next(
            (
                stamp_s - order.at_s
                for stamp_s in departures.get(order.node, ())
                if 0.0 <= stamp_s - order.at_s <= DELIVERED_WITHIN_S
            ),
            None,
        )
        for order in run.orders
    ]


def _note_traffic() -> None:
    """Two columns per message type: sent by its creator, and forwarded."""
    for kind in MessageType:
        word = kind.name.lower()
        for attribute, name, words in (
            ("own", "own", "sent by their creators"),
            ("forwarded", "fwd", "forwarded for others"),
        ):

            def count(run: RunRecord, kind: int = int(kind), attribute: str = attribute) -> float:
                traffic = run.traffic.get(kind)
                return 0.0 if traffic is None else float(getattr(traffic, attribute))

            METRICS[f"{name}_{word}"] = Metric(
                "packets", f"{kind.name} packets {words}, tries included", count, "less"
            )


_note_traffic()
