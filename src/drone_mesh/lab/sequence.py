"""One sequence: a random mesh, a few faults, and how its drones handled them."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import asdict, dataclass, field
from typing import Callable, Mapping

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.repair.options import CLEARANCE_M, DEFAULT_REPAIR
from drone_mesh.inprocess import Network
from drone_mesh.lab.random_layouts import cut_vertices, random_layout

SMALLEST, LARGEST = 8, 60  # nodes of a mesh
NOTICED_S = 12.0  # time in which each node checks its connection
HEALED_WITHIN_S = 120.0
SETTLED_S = 60.0  # time without changes
MOST_S = 1500.0  # after the last fault
STEP_S = 2.0  # sampling period
BESIDE_M = 1.0  # least distance of drones from the exact place of a gateway
ROUNDING_M = 1e-6


@dataclass
class SequenceOutcome:
    """The outcome of a sequence; counts are of nodes unless noted otherwise."""

    seed: int
    nodes: int
    incidents: str
    stacked: int = 0  # pairs of living drones at rest at the end
    flew_connected: int = 0  # flights of drones that were connected
    flew_grounded: int = 0  # flights of drones that cannot fly
    cut_off: int = 0  # nodes that a fault left without a radio path to a gateway
    healed: int = 0  # of these, connected again within 120 s
    unhealed: int = 0  # unconnected at the end
    unexplained: int = 0  # of these, the ones that can fly and know the gateway's place
    why: str = ""  # the reason of each unconnected one
    flights: int = 0
    flown_m: float = 0.0
    endless: int = 0  # heartbeats that reached the limit of hops
    took_s: float = 0.0  # simulated seconds


FIELDS = tuple(asdict(SequenceOutcome(0, 0, "")))


@dataclass
class Mesh:
    """A network during a sequence."""

    network: Network
    rng: random.Random
    points: list[tuple[float, float]]
    grounded: frozenset[int]
    dead: set[int] = field(default_factory=set)
    cut_off_s: dict[int, float] = field(default_factory=dict)  # node -> since when
    healed_s: dict[int, float] = field(default_factory=dict)  # node -> after how long
    cut_off: int = 0
    healed: int = 0

    def alive(self) -> list[int]:
        """Routers with power."""
        return [node for node in self.network.nodes if node and node not in self.dead]

    def run_for(self, seconds: float) -> None:
        """Let time pass, and record which nodes are connected again."""
        end_s = self.network.clock.now_s + seconds
        while self.network.clock.now_s < end_s:
            self.network.run_for(min(STEP_S, end_s - self.network.clock.now_s))
            self._note_healed()

    def kill(self, node: int) -> None:
        """Switch a router off permanently."""
        self.dead.add(node)
        self.cut_off_s.pop(node, None)
        self.network.power(node, False)

    def note_cut_off(self) -> None:
        """Record which nodes have no radio path to a gateway now."""
        with_path = self.network.shortest_hops()
        now_s = self.network.clock.now_s
        for node in self.alive():
            if node not in with_path and node not in self.cut_off_s:
                self.cut_off_s[node] = now_s
                self.cut_off += 1

    def _note_healed(self) -> None:
        now_s = self.network.clock.now_s
        for node, since_s in list(self.cut_off_s.items()):
            if self.network.connected(node):
                del self.cut_off_s[node]
                self.healed += now_s - since_s <= HEALED_WITHIN_S


def run_sequence(
    seed: int, repair: str = DEFAULT_REPAIR, largest: int = LARGEST
) -> SequenceOutcome:
    """Run the sequence with this seed and repair, in a mesh of 8..`largest` nodes.

    The same arguments give the same outcome.
    """
    mesh = _random_mesh(seed, repair, largest)
    network, rng = mesh.network, mesh.rng
    network.run_until(network.all_connected, within_s=60.0)
    names = rng.choices(list(INCIDENTS), k=rng.randint(1, 3))
    for name in names:
        INCIDENTS[name](mesh)
        mesh.note_cut_off()
        mesh.run_for(rng.uniform(5.0, 150.0))
    network.power(0, True)
    _settle(mesh)
    return _outcome(mesh, seed, " + ".join(names))


def _random_mesh(seed: int, repair: str, largest: int) -> Mesh:
    rng = random.Random(f"sequence {seed}")
    nodes = rng.randint(SMALLEST, largest)
    points = random_layout(rng, nodes, rng.uniform(7.0, 9.0), MAX_DISTANCE_M)
    share_grounded = rng.choice((0.0, 0.0, 0.1, 0.3))
    grounded = frozenset(n for n in range(1, nodes) if rng.random() < share_grounded)
    network = Network(seed=seed, loss=rng.choice((0.0, 0.0, 0.02, 0.05)), repair=repair)
    network.add_gateway(0, *points[0])
    for node, point in enumerate(points[1:], start=1):
        network.add_router(node, *point, why_not_fly="on the ground" if node in grounded else "")
    return Mesh(network, rng, points, grounded)


# Faults --------------------------------------------------------------------------------------


def _kill_cut_vertex(mesh: Mesh) -> None:
    vertices = [v for v in cut_vertices(mesh.points, MAX_DISTANCE_M, 0) if v not in mesh.dead]
    mesh.kill(mesh.rng.choice(vertices or mesh.alive()))


def _kill_many(mesh: Mesh) -> None:
    alive = mesh.alive()
    for node in mesh.rng.sample(alive, math.ceil(mesh.rng.uniform(0.01, 0.5) * len(alive))):
        if len(mesh.alive()) > 1:
            mesh.kill(node)


def _gateway_off(mesh: Mesh) -> None:
    mesh.network.power(0, False)
    mesh.note_cut_off()
    mesh.run_for(mesh.rng.uniform(20.0, 400.0))
    mesh.network.power(0, True)


def _gateway_moves(mesh: Mesh) -> None:
    network, rng = mesh.network, mesh.rng
    here = network.location(0)
    taken = [network.location(node) for node in network.nodes if node]
    while True:
        x, y = here.longitude + rng.uniform(-15, 15), here.latitude + rng.uniform(-15, 15)
        if all(math.hypot(x - t.longitude, y - t.latitude) > 1.0 for t in taken):
            break
    network.power(0, True)
    network.order(0, x, y)
    mesh.run_for(math.hypot(x - here.longitude, y - here.latitude) / 2.0 + 2.0)


def _kill_in_negotiation(mesh: Mesh) -> None:
    _kill_cut_vertex(mesh)
    mesh.note_cut_off()
    _kill_at(mesh, MeshEventKind.NEGOTIATION_STARTED, mesh.rng.choice((0.0, 0.01, 0.5, 1.4)))


def _kill_in_flight(mesh: Mesh) -> None:
    _kill_cut_vertex(mesh)
    mesh.note_cut_off()
    _kill_at(mesh, MeshEventKind.FLIGHT_DECIDED, mesh.rng.uniform(0.0, 4.0))


def _kill_at(mesh: Mesh, kind: MeshEventKind, after_s: float) -> None:
    """Kill the first router with an event of this kind, shortly after it."""
    seen = len(mesh.network.events)
    until_s = mesh.network.clock.now_s + 60.0
    while mesh.network.clock.now_s < until_s:
        mesh.network.run_for(0.1)
        for event in mesh.network.events[seen:]:
            if event.kind is kind and event.node not in mesh.dead and len(mesh.alive()) > 1:
                mesh.run_for(after_s)
                mesh.kill(event.node)
                return
        seen = len(mesh.network.events)


INCIDENTS: Mapping[str, Callable[[Mesh], None]] = {
    "cut vertex killed": _kill_cut_vertex,
    "many killed": _kill_many,
    "gateway off": _gateway_off,
    "gateway moved": _gateway_moves,
    "killed in negotiation": _kill_in_negotiation,
    "killed in flight": _kill_in_flight,
}


# Outcome -------------------------------------------------------------------------------------


def _settle(mesh: Mesh) -> None:
    """Let time pass until nothing changes."""
    network = mesh.network
    end_s = network.clock.now_s + MOST_S
    mesh.run_for(NOTICED_S)
    quiet_since_s = network.clock.now_s
    before: object = None
    while network.clock.now_s < end_s and network.clock.now_s - quiet_since_s < SETTLED_S:
        mesh.run_for(10.0)
        now = [
            (network.connected(node), tuple(network.location(node)), _may_still_fly(mesh, node))
            for node in mesh.alive()
        ]
        if now != before or any(state[2] for state in now):
            quiet_since_s = network.clock.now_s
        before = now


def _may_still_fly(mesh: Mesh, node: int) -> bool:
    return not mesh.network.connected(node) and _is_able(mesh, node)


def _is_able(mesh: Mesh, node: int) -> bool:
    """Whether a drone can fly and the gateway is in range of its believed place."""
    believed = mesh.network.nodes[node].component.places.gateway
    if believed is None or node in mesh.grounded:
        return False
    return believed.distance_m(mesh.network.location(0)) < MAX_DISTANCE_M - BESIDE_M


def _outcome(mesh: Mesh, seed: int, incidents: str) -> SequenceOutcome:
    network = mesh.network
    outcome = SequenceOutcome(seed, len(network.nodes), incidents)
    resting = {
        node: network.location(node)
        for node in [0, *mesh.alive()]
        if network.nodes[node].drone.path is None
    }
    outcome.stacked = sum(
        one.distance_m(other) < CLEARANCE_M - ROUNDING_M
        for one, other in itertools.combinations(resting.values(), 2)
    )
    connected: set[int] = set()
    for event in network.events:
        if event.kind is MeshEventKind.CONNECTED:
            connected.add(event.node)
        elif event.kind is MeshEventKind.DISCONNECTED:
            connected.discard(event.node)
        elif event.kind is MeshEventKind.FLIGHT_DECIDED:
            outcome.flights += 1
            outcome.flew_connected += event.node in connected
            outcome.flew_grounded += event.node in mesh.grounded
    left = [node for node in mesh.alive() if not network.connected(node)]
    outcome.cut_off, outcome.healed = mesh.cut_off, mesh.healed
    outcome.unhealed = len(left)
    outcome.unexplained = sum(_is_able(mesh, node) for node in left)
    reasons = {n: network.nodes[n].component.get_repair_status() for n in left}
    outcome.why = " | ".join(
        f"{n}: {why.in_words(network.clock.now_s)}" for n, why in reasons.items()
    )
    outcome.flown_m = round(sum(node.drone.flown_m for node in network.nodes.values()), 2)
    outcome.endless = sum(
        count
        for node in network.nodes.values()
        for reason, count in node.component.complaints.counts.items()
        if "too many hops" in reason
    )
    outcome.took_s = round(network.clock.now_s, 1)
    return outcome
