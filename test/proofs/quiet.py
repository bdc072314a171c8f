"""Runs in which nothing is wrong, and the warnings that their nodes log: there should be none."""

from __future__ import annotations

import logging
from typing import Iterator, NamedTuple

from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.formations.layouts import GRID_CASE, Layouts
from drone_mesh.inprocess.network import Network

KEY = MeshKey(bytes(range(16)))
RADIOS = ("disc", "shared")
TECHNIQUES = ("child_table_tree", "beacon")
FLEET = 17  # routers of the default run
COLUMNS = 6
SPACING_M = 1.0
START_S, FLIGHT_S = 20.0, 100.0
CONNECT_S = 300.0  # at most: orders to drones that are not connected fail, which is worth a warning

LAYOUTS = Layouts.shipped()
CASES = sorted({*LAYOUTS.cases, *Layouts({}).cases})


class Run(NamedTuple):
    """One run: the fleet of the factory flies to a layout."""

    layout: int
    radio: str
    routing: str
    has_key: bool
    seed: int

    def __str__(self) -> str:
        key = "key" if self.has_key else "no key"
        return f"layout {self.layout}, {self.radio}, {self.routing}, {key}, seed {self.seed}"


class _Warnings(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


def warnings_of(run: Run) -> list[str]:
    """What the nodes warn of in this run."""
    logger, found = logging.getLogger("drone_mesh"), _Warnings()
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(found)
    try:
        _fly_to(run)
    finally:
        logger.removeHandler(found)
        logger.propagate = propagate
    return found.lines


def runs(seeds: int) -> Iterator[Run]:
    """All layouts, radios and techniques, without and with a key, one seed after the other.

    The grid of 100 drones takes minutes: it flies with the first seed only.
    """
    for seed in range(seeds):
        for layout in CASES:
            if layout == GRID_CASE and seed:
                continue
            for radio in RADIOS:
                for routing in TECHNIQUES:
                    for has_key in (False, True):
                        yield Run(layout, radio, routing, has_key, seed)


def _fly_to(run: Run) -> None:
    key = KEY if run.has_key else None
    network = Network(run.seed, radio=run.radio, routing=run.routing, key=key)
    orders = LAYOUTS.orders(run.layout)
    network.add_fleet(1, max(FLEET, *(order.node_id for order in orders)), COLUMNS, SPACING_M)
    network.run_for(START_S)
    network.run_until(network.all_connected, CONNECT_S)
    for drone, goal in orders:
        network.order(
            drone, goal.longitude, goal.latitude, int(goal.height), allow_shared_place=True
        )
    network.run_for(FLIGHT_S)
