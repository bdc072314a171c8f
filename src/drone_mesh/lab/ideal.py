"""Runs without packets: each drone knows everything immediately, and flies straight on a plane.

Published repair methods are evaluated in this way. It shows the best that a rule can do, and makes
our runs comparable with published tables; detection, decisions and routes take no time.
"""

from __future__ import annotations

import hashlib
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from drone_mesh.air.graph import Graph, within
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.ideal_plans import IDEAL_PLANS, ROUNDING_M
from drone_mesh.lab.ideal_rules import IDEAL_RULES, Swarm
from drone_mesh.lab.metrics import METRICS, STACKED_M, covered
from drone_mesh.lab.picking import cut_vertices_of
from drone_mesh.lab.places import draw_places
from drone_mesh.lab.scenario import Scenario, Streams

STEP_S = 0.1  # as in the published simulations


class Draw(NamedTuple):
    """A run's survivors and victims. Nodes are the rows of `start`."""

    scenario: Scenario
    start: np.ndarray  # (n, 2), m, of all
    alive: np.ndarray  # (m,), the survivors
    victims: list[int]
    home: int  # row of the first gateway left among the survivors


class Flown(NamedTuple):
    """The flights of a repair. Arrays have one row per survivor."""

    places: np.ndarray  # (n, 2), m, at the end
    metres: np.ndarray  # (n,)
    end_s: float  # of the last step
    touched: int  # pairs nearer than STACKED_M at some time


def run_ideal(scenario: Scenario, streams: Streams) -> tuple[dict[str, float], str]:
    """All metrics (NaN for those undefined without packets), and a hash of the final positions.

    Raises ConfigurationError if no gateway is left.
    """
    kill = scenario.faults[0].kill
    assert kill is not None  # ensured by the check of the file
    starts = draw_places(scenario.layout, scenario.range_m, streams.generator("layout"))
    places = np.array([(start.x, start.y) for start in starts])
    gateways = [index for index, start in enumerate(starts) if start.gateway]
    fit = [i for i in range(len(starts)) if not (kill.spare == "gateways" and i in gateways)]
    number = kill.number if kill.number is not None else round((kill.share or 0.0) * len(fit))
    rng = streams.generator("fault 0")
    if kill.pick == "cut_vertex":  # as in a run with packets, which draws the same victims
        rows: Any = places.tolist()
        graph = Graph(within(dict(enumerate(rows)), scenario.range_m))
        order = rng.sample(range(len(starts)), len(starts))
        victims = cut_vertices_of(graph, gateways, order, number)
    else:
        victims = rng.sample(fit, min(number, len(fit)))
    alive = sorted(set(range(len(starts))) - set(victims))
    homes = [alive.index(gateway) for gateway in gateways if gateway in alive]
    if not homes:
        raise ConfigurationError("model ideal: no gateway is left")
    draw = Draw(scenario, places, np.array(alive), victims, homes[0])
    return _measured(draw, _planned(draw) if scenario.repair in IDEAL_PLANS else _stepped(draw))


def _planned(draw: Draw) -> Flown:
    """The flights of a rule that plans all of them at once; to it the gateway has id 0."""
    scenario = draw.scenario
    ids = [0 if row == draw.home else row + (row < draw.home) for row in range(len(draw.alive))]
    starts = draw.start[draw.alive]
    places = {node: Location.from_vector((*place, 0.0)) for node, place in zip(ids, starts)}
    flown: dict[int, float] = {}
    if draw.victims:
        hole = Location.from_vector((*draw.start[draw.victims[0]], 0.0))
        places, flown = IDEAL_PLANS[scenario.repair](places, hole, scenario.range_m)
    end = np.array([places[node].to_vector()[:2] for node in ids])
    metres = np.array([flown.get(node, 0.0) for node in ids])
    return Flown(end, metres, float(metres.max()) / scenario.speed_m_s, 0)


def _stepped(draw: Draw) -> Flown:
    """The flights of a rule that decides in each step."""
    scenario, start = draw.scenario, draw.start
    range_m, step_m = scenario.range_m, scenario.speed_m_s * STEP_S
    places = start[draw.alive].copy()
    lost_near = _near_lost(places, start[draw.victims], range_m)
    before, flown = places.copy(), np.zeros(len(places))
    middle = (start.min(axis=0) + start.max(axis=0)) / 2
    near, parts = _parts(places, range_m)
    steps, most = 0, round(scenario.duration_s / STEP_S) - 1
    pairs: set[tuple[int, int]] = set()
    while parts.max() > 0 and steps < most:
        swarm = Swarm(places, before, parts, draw.home, lost_near, near, middle, step_m, range_m)
        moves = IDEAL_RULES[scenario.repair](swarm)
        before, places = places, places + moves
        flown += np.linalg.norm(moves, axis=1)
        steps += 1
        near, parts = _parts(places, range_m)
        pairs |= _touching(places, moves)
    return Flown(places, flown, steps * STEP_S, len(pairs))


def _measured(draw: Draw, repair: Flown) -> tuple[dict[str, float], str]:
    scenario, start, range_m = draw.scenario, draw.start, draw.scenario.range_m
    places, flown, end_s = repair.places, repair.metres, repair.end_s
    _near, first_parts = _parts(start[draw.alive], range_m)
    near, parts = _parts(places, range_m)
    healed = parts.max() == 0
    shifts = np.linalg.norm(places - start[draw.alive], axis=1)
    observed_s = (round(scenario.duration_s / STEP_S) - 1) * STEP_S
    values = dict.fromkeys(METRICS, math.nan)
    before_rows: Any = start.tolist()
    after_rows: Any = places.tolist()
    values.update(
        healed=float(healed),
        split=float(first_parts.max() > 0),
        cut_off=float((first_parts != first_parts[draw.home]).sum()),
        victims=float(len(draw.victims)),
        t_total_s=end_s if healed else math.nan,
        t_capped_s=end_s if healed else observed_s,
        t_detect_s=0.0 if healed else math.nan,
        t_decide_s=0.0 if healed else math.nan,
        t_fly_s=end_s if healed else math.nan,
        t_reroute_s=0.0 if healed else math.nan,
        observed_s=observed_s,
        connected_share=float((parts == parts[draw.home]).mean()),
        distance_total_m=float(flown.sum()),
        distance_max_m=float(flown.max()),
        distance_mean_m=float(flown[flown > 0].mean()) if (flown > 0).any() else 0.0,
        moved=float((flown > 0).sum()),
        displacement_mean_m=float(shifts.mean()),
        displacement_max_m=float(shifts.max()),
        collisions=float(repair.touched),
        stacked=float(len({row for pair in _close(places) for row in pair})),
        parts_before=1.0,
        parts_after=float(parts.max() + 1),
        degree_after=float(near.sum() / len(near)),
        coverage=covered(after_rows, range_m) / covered(before_rows, range_m),
    )
    digest = hashlib.sha256(np.round(places, 6).tobytes()).hexdigest()[:16]
    return values, digest


def _parts(places: np.ndarray, range_m: float) -> tuple[np.ndarray, np.ndarray]:
    """(which drones are near each other, number of each one's connected part)."""
    gaps = places[:, None] - places[None]
    near = (gaps * gaps).sum(axis=2) < (range_m + ROUNDING_M) ** 2
    np.fill_diagonal(near, False)
    return near, connected_components(near, directed=False)[1]


def _near_lost(places: np.ndarray, dead: np.ndarray, range_m: float) -> np.ndarray:
    mean = np.full_like(places, math.nan)
    if len(dead):
        lost = np.linalg.norm(places[:, None] - dead[None], axis=2) < range_m
        some = lost.any(axis=1)
        mean[some] = (lost[some] @ dead) / lost[some].sum(axis=1, keepdims=True)
    return mean


def _close(places: np.ndarray) -> set[tuple[int, int]]:
    gaps = places[:, None] - places[None]
    close = np.triu((gaps * gaps).sum(axis=2) < STACKED_M**2, k=1)
    return {(int(a), int(b)) for a, b in zip(*np.nonzero(close))}


def _touching(places: np.ndarray, moves: np.ndarray) -> set[tuple[int, int]]:
    moving = (moves != 0).any(axis=1)
    return {pair for pair in _close(places) if moving[pair[0]] or moving[pair[1]]}
