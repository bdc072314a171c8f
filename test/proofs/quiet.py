"""Runs in which nothing is wrong, and the warnings that their nodes log: there should be none.

But of orders that do not arrive: 100 at once are more than a channel of 250 kbit/s carries.
"""

from __future__ import annotations

import logging
import math
from typing import Iterator, NamedTuple

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.formations.layouts import GRID_CASE, Layouts
from drone_mesh.inprocess.network import Network
from proofs.stranger import RecordedPacket, Tap

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
    """What the nodes warn of in this run, without what is true of orders."""
    logger, found = logging.getLogger("drone_mesh"), _Warnings()
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(found)
    try:
        truths = _fly_to(run)
    finally:
        logger.removeHandler(found)
        logger.propagate = propagate
    return [line for line in found.lines if not line.startswith(truths)]


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


def _fly_to(run: Run) -> tuple[str, ...]:
    """How lines begin that are true of orders."""
    key = KEY if run.has_key else None
    network = Network(run.seed, radio=run.radio, routing=run.routing, key=key)
    orders = LAYOUTS.orders(run.layout)
    network.add_fleet(1, max(FLEET, *(order.node_id for order in orders)), COLUMNS, SPACING_M)
    network.run_for(START_S)
    network.run_until(network.all_connected, CONNECT_S)
    heard: list[RecordedPacket] = []
    network.nodes[0].receiver = Tap(network, 0, heard)
    for drone, goal in orders:
        network.order(
            drone, goal.longitude, goal.latitude, int(goal.height), allow_shared_place=True
        )
    network.run_for(FLIGHT_S)
    return tuple(f"node 0: an order for drone {order}" for order in _in_vain(network, heard))


def _in_vain(network: Network, heard: list[RecordedPacket]) -> Iterator[str]:
    """Drones that did not set out; those from which no reply had come when contact was lost."""
    flown = {it.node for it in network.events if it.kind is MeshEventKind.FLIGHT_ORDERED}
    replied_s: dict[int, float] = {}
    for at_s, _gateway, payload in heard:
        creator, _from, kind, *_ = messages.header(payload)
        if kind == MessageType.ORDER_REPLY:
            replied_s.setdefault(creator, at_s)
    for event in network.events:
        lost = event.kind is MeshEventKind.ORDER_LOST_CONTACT
        if event.kind is MeshEventKind.NO_ROUTE and event.node == 0 and event.peer not in flown:
            yield f"{event.peer} failed"
        elif lost and replied_s.get(event.peer, math.inf) > event.now_s:
            yield f"{event.peer} has an unknown outcome"
