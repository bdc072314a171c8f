"""How the cost of a delivered packet grows with the mesh: a table, and docs/pictures/growth.svg."""

from __future__ import annotations

import itertools
import math
import statistics
import time
from pathlib import Path
from typing import Mapping, Sequence

import numpy as np

from drone_mesh.inprocess import Network
from drone_mesh.mobility import Area, Mobility, tracks_of

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "growth.svg"
SPACING_M = 6.0
SIZES = (10, 26, 50, 101, 160, 254)
LARGE = 50  # exponents are of the meshes from this size on
SETTLE_S, SLICE_S, SLICES = 20.0, 5.0, 3  # simulated; the table has the median slice
SPEED_M_S = 0.3
MOTIONS = ("at rest", f"{SPEED_M_S:g} m/s")
ARMS = [*itertools.product(MOTIONS, ("disc", "shared"), ("beacon", "child_table_tree"))]
TICKS_US = (10, 20, 50, 100, 200)


def fleet(nodes: int, radio: str, routing: str, moving: bool) -> Network:
    """A square grid with its gateway in the middle; the routers may fly over its area."""
    columns = math.ceil(math.sqrt(nodes))
    rows = math.ceil(nodes / columns)
    network = Network(seed=1, radio=radio, routing=routing)
    middle = columns * (rows // 2) + columns // 2
    for node in range(nodes):
        x, y = SPACING_M * (node % columns), SPACING_M * (node // columns)
        (network.add_gateway if node == middle else network.add_router)(node, x, y)
    if moving:
        places = {node: network.location(node).to_vector() for node in network.nodes}
        area = Area(0.0, 0.0, SPACING_M * columns, SPACING_M * rows)
        mobility = Mobility("random_waypoint", speed_m_s=(SPEED_M_S, SPEED_M_S))
        network.fly(tracks_of(mobility, places, {middle}, area, seed=1))
    return network


def cost(network: Network) -> float:
    """Microseconds of processor time per delivered packet."""
    network.run_for(SETTLE_S)
    costs = []
    for _slice in range(SLICES):
        delivered, begun_s = network.air.delivered, time.process_time()
        network.run_for(SLICE_S)
        used_s = time.process_time() - begun_s
        costs.append(1e6 * used_s / max(1, network.air.delivered - delivered))
    network.stop()
    return statistics.median(costs)


def growth(sizes: Sequence[int]) -> None:
    """Measure all motions, radios, techniques and sizes; print the table and draw the picture."""
    from bench import head, row, say  # which needs psutil, and scripts/pace does not

    head(
        f"µs of processor time per delivered packet, and k in n^k from {LARGE} nodes on",
        *("radio", "routing", "drones", *(f"{nodes} nodes" for nodes in sizes), "k"),
    )
    large = [index for index, nodes in enumerate(sizes) if nodes >= LARGE]
    found = {}
    for motion, radio, routing in ARMS:
        costs = []
        for nodes in sizes:
            say(f"growth: {radio}, {routing}, {motion}, {nodes} nodes")
            costs.append(cost(fleet(nodes, radio, routing, motion != MOTIONS[0])))
        k, _ = np.polyfit(np.log(np.take(sizes, large)), np.log(np.take(costs, large)), 1)
        row(radio, f"`{routing}`", motion, *(f"{us:.0f}" for us in costs), f"{k:.2f}")
        found[motion, radio, routing] = costs
    draw(sizes, found)
    say(f"growth: {PICTURE}")


def draw(sizes: Sequence[int], found: Mapping[tuple[str, str, str], Sequence[float]]) -> None:
    """A panel for each motion; `found` has the arms in their order."""
    from drone_mesh.lab.figures import COLOURS, MARKERS  # only this needs matplotlib
    from drone_mesh.lab.run_report.drawing import figure_with, svg_of_its_own

    figure, panels = figure_with(4.2, columns=2)
    styles = [*zip(COLOURS, MARKERS, ("-", "--", "-", "--"))] * len(MOTIONS)
    for ((motion, radio, routing), costs), (colour, marker, line) in zip(found.items(), styles):
        panel = panels[MOTIONS.index(motion)]
        name = f"{routing}, {radio}"
        panel.plot(sizes, costs, color=colour, marker=marker, linestyle=line, label=name)
        panel.set(xscale="log", yscale="log", xlabel="nodes", title=f"drones: {motion}")
        panel.set_xticks(sizes, [str(nodes) for nodes in sizes])
        panel.set_yticks(TICKS_US, [str(tick) for tick in TICKS_US])
        panel.minorticks_off()
    panels[0].set_ylabel("µs of processor time per delivered packet")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    PICTURE.write_text(svg_of_its_own(figure), encoding="utf-8")
