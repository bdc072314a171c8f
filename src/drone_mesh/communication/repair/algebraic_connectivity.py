"""How well a set of places is connected: the second eigenvalue of its Laplacian, and its gradient.

A link weighs exp(-d^2 / 2 s^2), as in Sabattini et al. and Yang et al. (see `fiedler`), with s such
that it is worth AT_REACH at the reach. It is not 0 beyond, so that a lost link still pulls.
"""

from __future__ import annotations

import math
from typing import Sequence

Place = Sequence[float]
AT_REACH = 0.01  # weight of a link as long as the reach; 1 for two drones at one place
ROUNDS = 40  # of inverse iteration: a tenth between the eigenvalues 2 and 3 leaves 2 %


def widest_gap_m(places: Sequence[Place]) -> float:
    """The least range at which these are one part; 0 for one place."""
    away_m = [math.dist(places[0], place) for place in places]
    left, widest_m = set(range(1, len(places))), 0.0
    while left:
        nearest = min(left, key=lambda node: (away_m[node], node))
        left.remove(nearest)
        widest_m = max(widest_m, away_m[nearest])
        for node in left:
            away_m[node] = min(away_m[node], math.dist(places[nearest], places[node]))
    return widest_m


def steepness(reach_m: float) -> float:
    """1 / 2 s^2, so that the weight at the reach is AT_REACH."""
    return -math.log(AT_REACH) / (reach_m * reach_m)


def weights(places: Sequence[Place], reach_m: float) -> list[list[float]]:
    """The weight of each link; 0 from a place to itself."""
    steep = steepness(reach_m)
    return [
        [0.0 if a is b else math.exp(-steep * math.dist(a, b) ** 2) for b in places] for a in places
    ]


def fiedler(places: Sequence[Place], reach_m: float) -> tuple[float, list[float]]:
    """The second eigenvalue of the Laplacian of at least two places, and its unit vector.

    By inverse iteration: the power iteration of Yang et al. takes hundreds of rounds for a mesh
    that is about to break, whose second and third eigenvalue are both small.
    """
    links, size = weights(places, reach_m), len(places)
    degrees = [sum(row) for row in links]
    lift = max(degrees) / size  # the eigenvalue 0, of the vector of ones, becomes the largest
    rows = [[lift - link for link in row] for row in links]
    for node, degree in enumerate(degrees):
        rows[node][node] += degree
    lower = _cholesky(rows)
    # Not symmetric in the places, so that it has a part of every eigenvector.
    vector = [math.dist(places[0], place) + node * reach_m for node, place in enumerate(places)]
    for _round in range(ROUNDS):
        mean = sum(vector) / size
        vector = _solved(lower, [entry - mean for entry in vector])
        length = math.sqrt(sum(entry * entry for entry in vector))
        vector = [entry / length for entry in vector]
    value = sum(
        link * (vector[a] - vector[b]) ** 2
        for a, row in enumerate(links)
        for b, link in enumerate(row[:a])
    )
    return value, vector


def gradient(
    node: int, places: Sequence[Place], reach_m: float, vector: Sequence[float]
) -> list[float]:
    """How the second eigenvalue grows as this node moves, per metre along each axis."""
    here, steep = places[node], steepness(reach_m)
    grows = [0.0] * len(here)
    for other, there in enumerate(places):
        apart = math.dist(here, there)
        weight = math.exp(-steep * apart * apart) * (vector[node] - vector[other]) ** 2
        grows = [sum_ + 2.0 * steep * weight * (b - a) for sum_, a, b in zip(grows, here, there)]
    return grows


def _cholesky(rows: list[list[float]]) -> list[list[float]]:
    """The lower triangle whose square is this symmetric, positive matrix."""
    lower: list[list[float]] = []
    for at, row in enumerate(rows):
        new: list[float] = []
        for column in range(at + 1):
            above = lower[column] if column < at else new
            rest = row[column] - sum(a * b for a, b in zip(new, above))
            new.append(rest / above[column] if column < at else math.sqrt(rest))
        lower.append(new)
    return lower


def _solved(lower: list[list[float]], right: list[float]) -> list[float]:
    """x, where lower times its transpose times x is `right`."""
    half: list[float] = []
    for row, value in zip(lower, right):
        half.append((value - sum(a * b for a, b in zip(row, half))) / row[len(half)])
    for at in reversed(range(len(half))):
        half[at] = half[at] / lower[at][at]
        for before in range(at):
            half[before] -= lower[at][before] * half[at]
    return half
