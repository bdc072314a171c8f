"""Selects the drones that a fault affects."""

from __future__ import annotations

import math
import random
from typing import Collection, Sequence

from drone_mesh.air.graph import Graph
from drone_mesh.inprocess import Network
from drone_mesh.lab.impairments import Impairments
from drone_mesh.lab.network_sample import gateways_of, physical_graph
from drone_mesh.lab.scenario_parts import Pick


def pick_drones(
    pick: Pick, alive: bool, network: Network, impairments: Impairments, rng: random.Random
) -> list[int]:
    """The drones with power (or without, for `alive=False`) that this fault affects, in order.

    The order is drawn over all drones, so that with the same stream a smaller share is a subset of
    a larger one, whatever happened before.
    """
    gateways = set(gateways_of(network))
    spared = gateways if pick.spare == "gateways" else set()
    everyone = sorted(network.nodes)
    order = rng.sample(everyone, len(everyone))
    fit = [n for n in order if n not in spared and network.nodes[n].antenna.powered == alive]
    if pick.ids is not None:
        there = [n for n in pick.ids if n in network.nodes]
        return [n for n in there if network.nodes[n].antenna.powered == alive]
    if pick.number is not None:
        number = pick.number
    elif pick.share is not None:
        number = round(pick.share * (len(everyone) - len(spared)))
    else:
        number = len(fit)
    if pick.pick == "cut_vertex":
        return cut_vertices_of(physical_graph(network), gateways, order, number)
    if pick.pick == "circle":
        fit = _in_circle(pick, network, fit, rng)
    elif pick.pick == "next_to_gateway":
        near = {n for g in gateways for n in physical_graph(network).near.get(g, ())}
        fit = [n for n in fit if n in near]
    elif pick.pick == "busiest":
        fit.sort(key=lambda n: (-impairments.sent_by.get(n, 0), n))
    return fit[:number]


def cut_vertices_of(
    graph: Graph, gateways: Collection[int], order: Sequence[int], number: int
) -> list[int]:
    """Up to `number` nodes, each the first cut vertex in this order of what those before leave."""
    chosen: list[int] = []
    while len(chosen) < number:
        cuts = set(graph.cut_vertices(gateways))
        first = next((node for node in order if node in cuts), None)
        if first is None:
            break
        chosen.append(first)
        graph = graph.without([first])
    return chosen


def _in_circle(pick: Pick, network: Network, fit: Sequence[int], rng: random.Random) -> list[int]:
    places = {n: network.location(n) for n in network.nodes}
    if pick.center is not None:
        x, y = pick.center
    else:
        middle = places[rng.choice(sorted(places))]
        x, y = middle.longitude, middle.latitude
    assert pick.radius_m is not None  # ensured by the check of the file
    return [
        n
        for n in fit
        if math.dist((places[n].longitude, places[n].latitude), (x, y)) < pick.radius_m
    ]
