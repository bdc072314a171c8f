"""Compares a routing technique of your own with ChildTableTree: numbers, and a page with pictures.

PYTHONPATH=src python3 examples/own_routing.py                    the numbers
PYTHONPATH=src python3 examples/own_routing.py --page run.html    and a page about one run
"""

from __future__ import annotations

import argparse
import random
import statistics
from pathlib import Path
from typing import Sequence

from drone_mesh import NO_ROUTE, ChildTableTree
from drone_mesh.inprocess import MeshStatus, Network


class SteadyTree(ChildTableTree):
    """Keeps a route until it fails; ChildTableTree follows the latest heartbeat."""

    def proven_path_to_node(self, other: int, node: int) -> None:
        """A packet from `node` came through `other`: used only if there was no route to `node`."""
        if self.get_direction_to_node(node) == NO_ROUTE:
            self.other_can_communicate_with_node(other, node)


TECHNIQUES = ("child_table_tree", f"{__name__}:SteadyTree")
FAIL_AT_S, END_S, SAMPLE_S = 60.0, 180.0, 1.0  # simulated
FAILING = 0.3  # of all drones


def run(technique: str, seed: int, gridsize: int) -> tuple[list[MeshStatus], Network]:
    """A gateway and a grid of routers, some of which fail: the state every second."""
    network = Network(seed=seed, routing=technique)
    network.add_fleet(gateways=1, routers=gridsize**2 - 1, gridsize=gridsize, spacing=6.0)
    failing = random.Random(seed).sample(range(1, gridsize**2), int(FAILING * gridsize**2))
    states = []
    while network.clock.now_s < END_S:
        if failing and network.clock.now_s >= FAIL_AT_S:
            for node in failing:
                network.power(node, on=False)
            failing = []
        network.run_for(SAMPLE_S)
        states.append(network.status())
    return states, network


def numbers(states: Sequence[MeshStatus], network: Network) -> tuple[float, float, int, int]:
    """Share connected at the end, seconds until it stayed so, packets sent, most by one router."""
    last = states[-1]
    way = network.shortest_hops()
    connected = [node.id for node in last.nodes if node.id in way and node.connected]
    unsteady = [
        state.stamp_s
        for state in states
        if not all(node.connected for node in state.nodes if node.id in connected)
    ]
    healed_s = max(unsteady, default=FAIL_AT_S) - FAIL_AT_S
    sent = {node.id: node.total_messages for node in last.nodes}
    busiest = max(count for node, count in sent.items() if not network.nodes[node].is_gateway)
    return len(connected) / len(way), max(0.0, healed_s), sum(sent.values()), busiest


def main() -> None:
    """Print the comparison; with --page, also write a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5, help="seeds per technique; default: 5")
    parser.add_argument("--gridsize", type=int, default=10, help="drones in a row; default: 10")
    parser.add_argument("--page", type=Path, help="write a page about the last run to this file")
    options = parser.parse_args()
    if options.runs < 1 or options.gridsize < 2:
        parser.error("--runs must be 1 or more, --gridsize 2 or more")
    if options.page:
        try:  # here, because only pages need them; now, because a comparison takes minutes
            from drone_mesh.lab import render_page, tell_story
        except ImportError as error:
            parser.error(f"--page needs matplotlib and jinja2: {error}")
    print("technique                   connected   healed after   packets   most by one router")
    for technique in TECHNIQUES:
        found = []
        for seed in range(options.runs):
            states, network = run(technique, seed, options.gridsize)
            found.append(numbers(states, network))
        share, healed_s, packets, busiest = map(statistics.median, zip(*found))
        print(f"{technique:26} {share:10.1%} {healed_s:12.0f} s {packets:9.0f} {busiest:20.0f}")
    if options.page:
        story = tell_story(states, network.event_records())
        options.page.write_text(render_page(story, technique), encoding="utf-8")
        print(f"wrote {options.page}")


if __name__ == "__main__":
    main()
