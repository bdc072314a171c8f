"""One mesh on a shared channel, on emulated chips or on the fast model, and its figures."""

from __future__ import annotations

import math
import random
import time
from dataclasses import dataclass, replace
from typing import Iterable

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.communication.observer import MeshEvent, MeshEventKind
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.chip_air import ChipAir, ChipAntenna
from drone_mesh.inprocess.network import Network
from drone_mesh.inprocess.shared_air import SharedAir
from drone_mesh.inprocess.shared_antenna import SharedAntenna
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance, ScriptedLoss
from drone_mesh.nrf24.settings import DEFAULT_RATE, data_rate

CHIPS, MODEL, DISC = "chips", "model", "disc"
SAMPLE_S = 0.1  # sampling period of the nodes' connections
SETTLE_S = 20.0  # from "all connected" to the fault of the trial
GATEWAY = 0


@dataclass(frozen=True)
class AirTrial:
    """A gateway and routers on a grid, or at given positions."""

    nodes: int
    rate: str = DEFAULT_RATE
    spacing_m: float = 6.0
    links: str = "disc"  # or "distance": the power falls with it, the edge of the range at 9 m
    loss: float = 0.0  # share of frames that are dropped deliberately
    seed: int = 1
    places: tuple[tuple[float, float], ...] = ()  # x, y of the routers 1, 2, ...; none: a grid

    def router_places(self) -> tuple[tuple[float, float], ...]:
        """x, y in metres of the routers 1, 2, ..."""
        if self.places:
            return self.places
        columns = max(1, round((self.nodes - 1) ** 0.5))
        grid = (divmod(index, columns) for index in range(self.nodes - 1))
        return tuple((self.spacing_m * column, self.spacing_m * row) for row, column in grid)


@dataclass(frozen=True)
class TrialFigures:
    """The result of one trial."""

    connected_s: float  # when all were connected for the first time; infinity: never
    share: float  # of node-seconds connected after that, without the gateway
    frames: int
    collided: float  # receptions that another frame destroyed, per frame
    airtime: float  # of all frames together, share of the time
    lost: int  # packets that were given up
    tries: float  # per delivered packet
    simulated_s: float
    cpu_s: float
    warnings: int  # misuse of chips


def make_mesh(trial: AirTrial, kind: str) -> Network:
    """The mesh of a trial on CHIPS, the MODEL or the DISC; all nodes start together."""
    if kind == DISC:
        network = Network(seed=trial.seed, loss=trial.loss)
    else:
        radio = "chips" if kind == CHIPS else "shared"
        network = Network(seed=trial.seed, radio=radio, rate=trial.rate, links=_links(trial))
    network.add_gateway(GATEWAY, -1.0, 0.0)
    for index, (x, y) in enumerate(trial.router_places()):
        network.add_router(index + 1, x, y)
    return network


def watch(trial: AirTrial, kind: str, within_s: float, after_s: float) -> TrialFigures:
    """Wait at most `within_s` until all are connected, then observe them for `after_s`."""
    cpu_s = time.process_time()
    mesh = make_mesh(trial, kind)
    connected_s = connect(mesh, within_s)
    share = 0.0
    if connected_s < math.inf:
        share = share_connected(mesh, range(1, trial.nodes), after_s)
    air, simulated_s = mesh.air, mesh.now_s()
    assert isinstance(air, (SharedAir, ChipAir))
    antennas = [node.antenna for node in mesh.nodes.values()]
    radios = [a.statistics() for a in antennas if isinstance(a, (SharedAntenna, ChipAntenna))]
    mesh.stop()
    return TrialFigures(
        connected_s,
        share,
        air.frames,
        air.collisions / max(air.frames, 1),
        air.airtime_s / simulated_s,
        sum(radio.lost for radio in radios),
        1 + sum(radio.tries for radio in radios) / max(sum(r.acknowledged for r in radios), 1),
        simulated_s,
        time.process_time() - cpu_s,
        len(air.warnings()) if isinstance(air, ChipAir) else 0,
    )


def connect(mesh: Network, within_s: float) -> float:
    """Time until all were connected; infinity if longer than `within_s`."""
    until_s = mesh.now_s() + within_s
    while not mesh.all_connected():
        if mesh.now_s() >= until_s:
            return math.inf
        mesh.run_for(SAMPLE_S)
    return mesh.now_s()


def share_connected(mesh: Network, nodes: Iterable[int], seconds: float) -> float:
    """Share of node-seconds that these nodes are connected."""
    nodes = list(nodes)
    samples = round(seconds / SAMPLE_S)
    connected = 0
    for _ in range(samples):
        mesh.run_for(SAMPLE_S)
        connected += sum(map(mesh.connected, nodes))
    return connected / (samples * len(nodes))


@dataclass(frozen=True)
class Losses:
    """The recovery of a mesh in which nodes died."""

    back_s: float  # after the deaths: last time at which a node with a path was unconnected
    cut_off: int  # survivors without any path to the gateway
    flights: int  # decided by nodes that had a path, which only congestion can cause
    flown: tuple[int, ...]  # all drones that decided to fly


def kill(
    trial: AirTrial, kind: str, dead: Iterable[int], seconds: float, repair: bool = False
) -> Losses:
    """Connect, switch nodes off, and observe the survivors that still have a path.

    `repair`: observe all survivors, because a drone is expected to fly for the others.
    """
    mesh = make_mesh(trial, kind)
    connect(mesh, 120.0)
    mesh.run_for(SETTLE_S)
    dead = frozenset(dead)
    for node in sorted(dead):
        mesh.power(node, False)
    died_s = mesh.now_s()
    alive = [node for node in range(trial.nodes) if node not in dead]
    reachable = with_a_path({node: mesh.location(node) for node in alive})
    watched = [node for node in alive if node != GATEWAY] if repair else reachable
    last_s = 0.0
    while mesh.now_s() < died_s + seconds:
        mesh.run_for(SAMPLE_S)
        if not all(map(mesh.connected, watched)):
            last_s = mesh.now_s() - died_s
    flown = [
        event.node
        for event in mesh.events
        if event.kind is MeshEventKind.FLIGHT_DECIDED and event.now_s >= died_s
    ]
    mesh.stop()
    return Losses(
        last_s,
        len(alive) - len(reachable) - 1,
        sum(node in reachable for node in flown),
        tuple(sorted(set(flown))),
    )


def with_a_path(places: dict[int, Location]) -> frozenset[int]:
    """The nodes, without the gateway, that a chain of ideal-disc links connects to the gateway."""
    found, edge = {GATEWAY}, [GATEWAY]
    while edge:
        here = places[edge.pop()]
        for node, place in places.items():
            if node not in found and here.distance_m(place) < MAX_DISTANCE_M:
                found.add(node)
                edge.append(node)
    return frozenset(found - {GATEWAY})


@dataclass(frozen=True)
class Orders:
    """The outcomes of orders."""

    sent: int
    in_time: int  # reached their drone within two seconds
    later: int
    reported: int  # of the rest: reported by the gateway that sent them


def give_orders(trial: AirTrial, kind: str, count: int, flight_m: float) -> Orders:
    """One order a second to a random drone, to a point `flight_m` from its position in the grid."""
    mesh = make_mesh(trial, kind)
    connect(mesh, 120.0)
    mesh.run_for(SETTLE_S)
    rng = random.Random(f"{trial.seed} orders")
    homes = {node: mesh.location(node) for node in range(1, trial.nodes)}
    sent: list[tuple[float, int]] = []
    for _ in range(count):
        lately = {node for _, node in sent[-10:]}  # the drone's id identifies the order
        node = rng.choice([node for node in homes if node not in lately])
        home, direction = homes[node], 2.0 * math.pi * rng.random()
        sent.append((mesh.now_s(), node))
        mesh.order(
            node,
            home.longitude + flight_m * math.cos(direction),
            home.latitude + flight_m * math.sin(direction),
        )
        mesh.run_for(1.0)
    mesh.run_for(10.0)
    mesh.stop()
    took = [_first_s(mesh.events, MeshEventKind.FLIGHT_ORDERED, node, at_s) for at_s, node in sent]
    missed = [order for order, took_s in zip(sent, took) if took_s > 10.0]
    return Orders(
        len(sent),
        sum(took_s <= 2.0 for took_s in took),
        sum(2.0 < took_s <= 10.0 for took_s in took),
        sum(_reported(mesh.events, node, at_s) for at_s, node in missed),
    )


def _first_s(events: list[MeshEvent], kind: MeshEventKind, node: int, since_s: float) -> float:
    """Time from `since_s` to the node's first event of this kind; infinity if there is none."""
    after = (e.now_s - since_s for e in events if e.kind is kind and e.node == node)
    return min((passed_s for passed_s in after if passed_s >= 0), default=math.inf)


def _reported(events: list[MeshEvent], node: int, since_s: float) -> bool:
    return any(
        event.kind is MeshEventKind.NO_ROUTE
        and event.node == GATEWAY
        and event.peer == node
        and 0.0 <= event.now_s - since_s <= 10.0
        for event in events
    )


def with_seed(trial: AirTrial, seed: int) -> AirTrial:
    """The same trial with another seed."""
    return replace(trial, seed=seed)


def _links(trial: AirTrial) -> LinkModel:
    links: LinkModel = IdealDisc(MAX_DISTANCE_M)
    if trial.links == "distance":
        links = LogDistance.with_edge_at(
            MAX_DISTANCE_M,
            random.Random(f"{trial.seed} links"),
            bits_per_s=data_rate(trial.rate).value,
        )
    if trial.loss:
        rng = random.Random(f"{trial.seed} loss")
        return ScriptedLoss(links, lambda _hop: rng.random() < trial.loss)
    return links
