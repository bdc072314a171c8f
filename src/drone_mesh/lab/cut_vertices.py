"""Kills each cut vertex of random layouts once: `python3 -m drone_mesh.lab.cut_vertices --help`."""

from __future__ import annotations

import argparse
import math
import random
import sys
from typing import Callable, Iterator, NamedTuple, Sequence

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.inprocess import Network
from drone_mesh.lab import ideal_moves
from drone_mesh.lab.ideal_moves import Flown
from drone_mesh.lab.quiet import quiet_nodes
from drone_mesh.lab.random_layouts import Point, cut_vertices, random_layout

LAYOUTS = {20: 40, 50: 20, 100: 8}  # drones -> layouts, the same number as for the ideal figures
SIDE_M = {20: 24.0, 50: 37.5, 100: 56.25}  # of the square: 120 m of range scaled to 9 m
HEALED_WITHIN_S = 300.0
CALM_S = 30.0  # afterwards: drones that still follow have landed by then
IDEAL: dict[str, Callable[..., Flown]] = {
    "nearest": ideal_moves.nearest,
    "inward": ideal_moves.inward,
}


class FlightMeans(NamedTuple):
    """Means over all deaths; distances in units of the range."""

    total: float
    longest: float  # of one drone
    moved: float  # drones

    @classmethod
    def of(cls, flown: Sequence[Flown]) -> FlightMeans:
        """The means."""
        count = max(1, len(flown))
        return cls(
            sum(sum(one.values()) for one in flown) / count / MAX_DISTANCE_M,
            sum(max(one.values(), default=0.0) for one in flown) / count / MAX_DISTANCE_M,
            sum(map(len, flown)) / count,
        )

    def in_words(self) -> str:
        """As in the tables of the literature."""
        return f"{self.total:.2f} / {self.longest:.2f} / {self.moved:.1f}"


def main(argv: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="drone_mesh.lab.cut_vertices",
        description="Kills every cut vertex of random layouts once and prints how far the drones "
        "fly: total / longest / drones that moved, as means, with distances in units of the range. "
        "For comparison it prints the same figures for a planner with ideal information: one that "
        "may move all drones, and one that moves only the drones cut off from the gateway, as the "
        "strategies do.",
    )
    parser.add_argument("--drones", type=int, nargs="+", default=[20, 50, 100], choices=LAYOUTS,
        help="sizes of the meshes (default: all)",
    )  # fmt: skip
    parser.add_argument(
        "--layouts", type=int, help="number of layouts per number of drones (default: 40, 20 and 8)"
    )
    parser.add_argument(
        "--repair", nargs="+", default=list(IDEAL), choices=IDEAL, help="strategies (default: both)"
    )
    options = parser.parse_args(argv)
    print("| drones | cut vertices | repair | ideal, all move | ideal, cut-off drones move | runs "
          "| healed | runs / ideal |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    with quiet_nodes():
        for drones in options.drones:
            deaths = list(_deaths(drones, options.layouts or LAYOUTS[drones]))
            for repair in options.repair:
                print(_row(drones, deaths, repair), flush=True)
    return 0


def _deaths(drones: int, layouts: int) -> Iterator[tuple[Sequence[Point], int]]:
    degree = drones * math.pi * MAX_DISTANCE_M**2 / SIDE_M[drones] ** 2 - 1.0
    for number in range(layouts):
        rng = random.Random(f"cut vertices {drones} {number}")
        points = random_layout(rng, drones, degree, MAX_DISTANCE_M)
        for vertex in cut_vertices(points, MAX_DISTANCE_M, 0):
            yield points, vertex


def _row(drones: int, deaths: Sequence[tuple[Sequence[Point], int]], repair: str) -> str:
    everywhere, behind, runs, healed = [], [], [], 0
    for number, (points, vertex) in enumerate(deaths):
        places, hole = ideal_moves.without(points, vertex), ideal_moves.place(points[vertex])
        lost = ideal_moves.cut_off(places, MAX_DISTANCE_M, 0)
        everywhere.append(IDEAL[repair](places, hole, MAX_DISTANCE_M, places.keys()))
        behind.append(IDEAL[repair](places, hole, MAX_DISTANCE_M, lost))
        is_healed, flown = _run(points, vertex, repair, number)
        healed += is_healed
        runs.append(flown)
    ideal, measured = FlightMeans.of(behind), FlightMeans.of(runs)
    ratio = measured.total / ideal.total if ideal.total else math.nan
    return (
        f"| {drones} | {len(deaths)} | {repair} | {FlightMeans.of(everywhere).in_words()} "
        f"| {ideal.in_words()} | {measured.in_words()} | {healed} of {len(deaths)} | {ratio:.2f} |"
    )


def _run(points: Sequence[Point], vertex: int, repair: str, seed: int) -> tuple[bool, Flown]:
    """The same death in a network: whether it healed, and how far each drone flew."""
    network = Network(seed=seed, repair=repair)
    network.add_gateway(0, *points[0])
    for node, point in enumerate(points[1:], start=1):
        network.add_router(node, *point)
    network.run_until(network.all_connected, within_s=60.0)
    network.run_for(20.0)  # each node has requested its next hop's place
    network.power(vertex, False)
    network.run_for(15.0)  # the loss is noticed
    is_healed = network.run_until(network.all_connected, within_s=HEALED_WITHIN_S)
    network.run_for(CALM_S)
    flown = {node: each.drone.flown_m for node, each in network.nodes.items()}
    return is_healed, {node: metres for node, metres in flown.items() if metres > 0.0}


if __name__ == "__main__":
    sys.exit(main())
