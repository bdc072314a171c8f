"""Runs without packets: each drone knows everything immediately, and flies straight on a plane.

Published repair methods are evaluated in this way. It shows the best that a rule can do, and makes
our runs comparable with published tables; detection, decisions and routes take no time.
"""

from __future__ import annotations

import functools
import hashlib
import math
from typing import Any, Callable, NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from drone_mesh.air.graph import Graph, within
from drone_mesh.communication.repair.algebraic_connectivity import steepness
from drone_mesh.communication.repair.virtual_spring import REST
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.ideal_plans import IDEAL_PLANS, ROUNDING_M
from drone_mesh.lab.metrics import METRICS, STACKED_M, covered
from drone_mesh.lab.picking import cut_vertices_of
from drone_mesh.lab.places import draw_places
from drone_mesh.lab.scenario import Scenario, Streams

STEP_S = 0.1  # as in the published simulations
ARRIVED_M = 1e-9


class Swarm(NamedTuple):
    """The survivors at one step. Arrays have one row per survivor."""

    places: np.ndarray  # (n, 2), m
    before: np.ndarray  # (n, 2), m, one step ago
    parts: np.ndarray  # (n,), number of the connected part
    home: int  # row of the gateway
    near_lost: np.ndarray  # (n, 2), m, mean place of lost neighbours; NaN: none lost
    near: np.ndarray  # (n, n), which drones are in range of each other
    middle: np.ndarray  # (2,), m, of the area
    step_m: float  # flown in one step
    range_m: float


Rule = Callable[[Swarm], np.ndarray]
"""Displacement of each survivor in this step, (n, 2) in metres, not longer than step_m."""


def centering(swarm: Swarm) -> np.ndarray:
    """All fly to the mean of all survivors, to within one metre per 120 m of range."""
    return _towards(swarm, swarm.places.mean(axis=0), stop_m=swarm.step_m)


def home(swarm: Swarm) -> np.ndarray:
    """Drones without a path to the gateway fly to it; a part stops once it has one."""
    return _of_those_that_act(swarm, _towards(swarm, swarm.places[swarm.home]), all_act=False)


def oracle(swarm: Swarm) -> np.ndarray:
    """Each part without a gateway moves as a block to the nearest drone with one.

    It moves by the shortest vector into range: no rule can connect a single part with less.
    """
    moves = np.zeros_like(swarm.places)
    rooted = np.flatnonzero(swarm.parts == swarm.parts[swarm.home])
    parts: Any = swarm.parts.tolist()
    for part in set(parts) - {parts[swarm.home]}:
        own = np.flatnonzero(swarm.parts == part)
        gaps = swarm.places[rooted][None] - swarm.places[own][:, None]
        lengths = np.linalg.norm(gaps, axis=2)
        mine, other = np.unravel_index(np.argmin(lengths), lengths.shape)
        gap, length = gaps[mine, other], lengths[mine, other]
        moves[own] = gap / length * min(swarm.step_m, length)
    return moves


def hero(swarm: Swarm) -> np.ndarray:
    """Towards the lost neighbours; a drone that lost none follows the mean of its neighbours.

    Mi, Yang, Liu, ICRA 2011, as described; only neighbours are known.
    """
    lost = ~np.isnan(swarm.near_lost[:, 0])
    moves = np.zeros_like(swarm.places)
    moves[lost] = _towards(swarm, swarm.near_lost)[lost]
    counts = swarm.near.sum(axis=1, keepdims=True)
    change = swarm.near @ (swarm.places - swarm.before) / np.maximum(counts, 1)
    length = np.linalg.norm(change, axis=1, keepdims=True)
    follow = np.divide(change, length, out=np.zeros_like(change), where=length > ARRIVED_M)
    moves[~lost] = follow[~lost] * swarm.step_m
    return moves


def sidr(swarm: Swarm) -> np.ndarray:
    """Each part flies as a block from its own mean to the middle of the area.

    Chen, Wang, Chang, Wei, IEEE Access 8:77089, 2020, as described.
    """
    return _blocks(swarm, lambda mean: swarm.middle - mean)


def sidr_as_coded(swarm: Swarm) -> np.ndarray:
    """SIDR as implemented in two public repositories: the mean is one number for x and y.

    Every part then flies along a diagonal, wherever it is.
    """
    return _blocks(swarm, lambda mean: swarm.middle - mean.mean())


def virtual_spring(swarm: Swarm, all_act: bool = False) -> np.ndarray:
    """As the strategy of this name, without its legs; `all_act`: as published, all but the gateway.

    The drones that are cut off and their neighbours push under REST and pull over it.
    """
    gaps = swarm.places[None] - swarm.places[:, None]
    lengths = np.linalg.norm(gaps, axis=2)
    stretch = np.where(swarm.near & (lengths > 0), 1 - REST * swarm.range_m / (lengths + 1e-300), 0)
    counts = np.maximum(swarm.near.sum(axis=1, keepdims=True), 1)
    springs = (gaps * stretch[:, :, None]).sum(axis=1) / counts
    goals = swarm.places[swarm.home] + springs
    return _of_those_that_act(swarm, _towards(swarm, goals), all_act)


def fiedler(swarm: Swarm, all_act: bool = False) -> np.ndarray:
    """Along the gradient of the second eigenvalue of all, the one with the steepest at full speed.

    As the strategy of this name; `all_act`: as published, all but the gateway.
    """
    gaps = swarm.places[None] - swarm.places[:, None]
    lengths = np.linalg.norm(gaps, axis=2)
    reach_m = max(swarm.range_m, float(minimum_spanning_tree(lengths).max()))
    links = np.exp(-steepness(reach_m) * lengths**2)
    vector = np.linalg.eigh(np.diag(links.sum(axis=1)) - links)[1][:, 1]
    pulls = links * (vector[None] - vector[:, None]) ** 2
    uphill = _of_those_that_act(swarm, (gaps * pulls[:, :, None]).sum(axis=1), all_act)
    steepest = float(np.linalg.norm(uphill, axis=1).max())
    return uphill * (swarm.step_m / steepest) if steepest else uphill


IDEAL_RULES: dict[str, Rule] = {
    "centering": centering,
    "home": home,
    "oracle": oracle,
    "hero": hero,
    "sidr": sidr,
    "sidr_as_coded": sidr_as_coded,
    "virtual_spring": virtual_spring,
    "virtual_spring_of_all": functools.partial(virtual_spring, all_act=True),
    "fiedler": fiedler,
    "fiedler_of_all": functools.partial(fiedler, all_act=True),
}


def _of_those_that_act(swarm: Swarm, moves: np.ndarray, all_act: bool) -> np.ndarray:
    """These moves of the drones that are cut off, or of all but the gateway."""
    parts = swarm.parts
    stays = np.arange(len(parts)) == swarm.home if all_act else parts == parts[swarm.home]
    moves[stays] = 0.0
    return moves


def _towards(swarm: Swarm, goal: np.ndarray, stop_m: float = ARRIVED_M) -> np.ndarray:
    gap = goal - swarm.places
    length = np.linalg.norm(gap, axis=1, keepdims=True)
    step = np.minimum(swarm.step_m, length)
    step[length <= stop_m] = 0.0
    unit: np.ndarray = np.divide(gap, length, out=np.zeros_like(gap), where=length > ARRIVED_M)
    moves: np.ndarray = unit * step
    return moves


def _blocks(swarm: Swarm, direction: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    moves = np.zeros_like(swarm.places)
    for part in set(swarm.parts.tolist()):
        own = swarm.parts == part
        way = direction(swarm.places[own].mean(axis=0))
        length = float(np.linalg.norm(way))
        if length > ARRIVED_M:
            moves[own] = way / length * min(swarm.step_m, length)
    return moves


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
