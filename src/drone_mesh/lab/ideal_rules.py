"""Where drones that know everything fly in the next step, by rule, on a plane."""

from __future__ import annotations

import functools
from typing import Any, Callable, NamedTuple

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from drone_mesh.communication.repair.algebraic_connectivity import steepness
from drone_mesh.communication.repair.virtual_spring import REST

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
