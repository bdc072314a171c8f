"""A sequence: a random mesh and a few random faults, until its drones have come to rest."""

from __future__ import annotations

import math
import random
from typing import Iterator

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.repair.options import CLEARANCE_M, DEFAULT_REPAIR
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess.radio import InProcessAir
from drone_mesh.lab.flights import could_know
from drone_mesh.lab.network_sample import physical_graph
from drone_mesh.lab.record import RunRecord
from drone_mesh.lab.scenario import Layout, Radio, Scenario, Sequence, Streams
from drone_mesh.lab.simulation import Simulation

GATEWAY = 0
CONNECTED_WITHIN_S = 60.0
LEAST_DISTANCE_M = 1.0  # of drones at the start
NOTICED_S = 12.0  # time in which each node checks its connection
REST_S = 60.0  # time without changes
MOST_S = 1500.0  # after the last fault

Times = Iterator[float]
"""Time passes in it; yields the time of each sample."""


def run_sequence(
    number: int, repair: str = DEFAULT_REPAIR, largest: int | None = None
) -> RunRecord:
    """The sequence with this number, in a mesh of 8 to `largest` drones."""
    sequence = Sequence() if largest is None else Sequence(drones=[8, largest])
    scenario = Scenario(sequence=sequence, repair=repair, sample_s=2.0)
    return SequenceRun(scenario, Streams(0, number)).run()


class SequenceRun(Simulation):
    """The run of a sequence, on the disc. The same seed and scenario give the same run."""

    def __init__(self, scenario: Scenario, streams: Streams) -> None:
        """Raises ConfigurationError for a layout that cannot be drawn."""
        self._rng = streams.generator("sequence")
        super().__init__(_drawn(scenario, self._rng), streams)

    def samples(self) -> Times:
        """The whole sequence; yields the time (s) of each sample once it is taken."""
        network, rng = self.network, self._rng
        assert self.scenario.sequence is not None
        while not network.all_connected() and network.now_s() < CONNECTED_WITHIN_S:
            yield from self._passing(1.0)
        for name in rng.choices(self.scenario.sequence.incidents, k=rng.randint(1, 3)):
            self.timeline.note(name, [])
            yield from getattr(self, f"_{name}")()
            yield from self._passing(rng.uniform(5.0, 150.0))
        network.power(GATEWAY, True)
        yield from self._until_rest()

    def _passing(self, seconds: float) -> Times:
        return self.sampled_until(self.network.now_s() + seconds)

    def _until_rest(self) -> Times:
        network = self.network
        yield from self._passing(NOTICED_S)
        end_s, changed_s = network.now_s() + MOST_S, network.now_s()
        before: object = None
        while network.now_s() < min(end_s, changed_s + REST_S):
            yield from self._passing(10.0)
            lost = [node for node in self._alive() if not network.connected(node)]
            now = (lost, [network.location(node) for node in self._alive()])
            if now != before or any(map(self.is_able, lost)):
                changed_s = network.now_s()
            before = now

    def is_able(self, node: int) -> bool:
        """Also requires a working link to a node with a path to the gateway."""
        if node in self.impairments.one_way.mute | self.impairments.one_way.deaf:
            return False
        return super().is_able(node) and bool(self._helpers(node))

    def could_know_a_link(self, node: int) -> bool:  # noqa: D102
        network, helpers = self.network, self._helpers(node)
        if GATEWAY in helpers:
            return True

        def is_there(helper: int, told: Location) -> bool:
            return told.distance_m(network.location(helper)) < CLEARANCE_M

        return bool(could_know(network, node, helpers, is_there))

    def _helpers(self, node: int) -> list[int]:
        """The nodes with a path to the gateway whose link to this one is not cut."""
        air = self.network.air
        assert isinstance(air, InProcessAir)
        connected = physical_graph(self.network).hops_from([GATEWAY], {node})
        return [other for other in connected if not air.is_cut(node, other)]

    def _alive(self) -> list[int]:
        nodes = self.network.nodes
        return [n for n, node in nodes.items() if node.antenna.powered and not node.is_gateway]

    def _kill(self, nodes: list[int]) -> None:
        nodes = nodes[: len(self._alive()) - 1]  # a mesh keeps a router
        with self.timeline.disruption("kill", nodes):
            for node in nodes:
                self.network.power(node, False)

    # Incidents ---------------------------------------------------------------------------------

    def _cut_vertex_killed(self) -> Times:
        vertices = physical_graph(self.network).cut_vertices([GATEWAY])
        self._kill([self._rng.choice(vertices or self._alive())])
        return iter(())

    def _many_killed(self) -> Times:
        alive, rng = self._alive(), self._rng
        self._kill(rng.sample(alive, math.ceil(rng.uniform(0.01, 0.5) * len(alive))))
        return iter(())

    def _gateway_off(self) -> Times:
        with self.timeline.disruption("gateway_off", [GATEWAY]):
            self.network.power(GATEWAY, False)
        yield from self._passing(self._rng.uniform(20.0, 400.0))
        self.network.power(GATEWAY, True)

    def _gateway_moved(self) -> Times:
        network, rng = self.network, self._rng
        here = network.location(GATEWAY)
        taken = [network.location(node)[:2] for node in network.nodes if node != GATEWAY]
        drone, path = network.nodes[GATEWAY].drone, None
        while path is None:
            x, y = here.longitude + rng.uniform(-15, 15), here.latitude + rng.uniform(-15, 15)
            if all(math.dist((y, x), other) > LEAST_DISTANCE_M for other in taken):
                path = drone.plan_flight(here.to_vector(), (x, y, 0.0), 0.0, drone.speed_m_s)
        network.power(GATEWAY, True)
        network.order(GATEWAY, x, y, allow_shared_place=True)  # checked against the true places
        yield from self._passing(math.dist((y, x), here[:2]) / self.scenario.speed_m_s + 2.0)
        with self.timeline.disruption("gateway_moved", [GATEWAY]):
            pass

    def _killed_in_negotiation(self) -> Times:
        yield from self._cut_vertex_killed()
        after_s = self._rng.choice((0.0, 0.01, 0.5, 1.4))
        yield from self._killed_at(MeshEventKind.NEGOTIATION_STARTED, after_s)

    def _killed_in_flight(self) -> Times:
        yield from self._cut_vertex_killed()
        yield from self._killed_at(MeshEventKind.FLIGHT_DECIDED, self._rng.uniform(0.0, 4.0))

    def _silent_for_a_while(self) -> Times:
        """One to three antennas are off for a while; their drones still hang there."""
        rng, alive = self._rng, self._alive()
        vertices = physical_graph(self.network).cut_vertices([GATEWAY])
        silent = rng.sample(alive, min(rng.randint(1, 3), len(alive) - 1))
        if vertices and rng.random() < 0.7:
            silent = sorted({rng.choice(vertices), *silent[:1]})
        with self.timeline.disruption("silent", silent):
            for node in silent:
                self.network.power(node, False)
        yield from self._passing(rng.uniform(20.0, 200.0))
        for node in silent:
            self.network.power(node, True)

    def _links_cut(self) -> Times:
        """One to three links to next hops fail for good; the drones are as near as before."""
        network, air = self.network, self.network.air
        assert isinstance(air, InProcessAir)
        paths = [network.path_to_gateway(node) or [] for node in self._alive()]
        links = [path[:2] for path in paths if len(path) > 1]
        chosen = self._rng.sample(links, min(len(links), self._rng.randint(1, 3)))
        with self.timeline.disruption("cut", sorted({node for link in chosen for node in link})):
            for one, other in chosen:
                air.cut(one, other)
        return iter(())

    def _restarted_cut_off(self) -> Times:
        """A cut vertex dies; one to three routers restart soon after it, and know no place."""
        yield from self._cut_vertex_killed()
        yield from self._passing(self._rng.uniform(1.0, 60.0))
        alive = self._alive()
        for node in self._rng.sample(alive, min(self._rng.randint(1, 3), len(alive))):
            self.timeline.note("restart", [node])
            self.network.restart(node)

    def _goes_mute(self) -> Times:
        """Nobody hears a router any more, for a while or for good."""
        return self._breaks("mute", self.impairments.one_way.mute)

    def _goes_deaf(self) -> Times:
        """A router hears nobody any more, for a while or for good."""
        return self._breaks("deaf", self.impairments.one_way.deaf)

    def _breaks(self, what: str, broken: set[int]) -> Times:
        node = self._rng.choice(self._alive())
        with self.timeline.disruption(what, [node]):
            broken.add(node)
        if self._rng.random() < 0.5:
            yield from self._passing(self._rng.uniform(20.0, 200.0))
            broken.discard(node)

    def _killed_at(self, kind: MeshEventKind, after_s: float) -> Times:
        """Kill the first router with an event of this kind, shortly after it."""
        network = self.network
        seen, until_s = len(network.events), network.now_s() + 60.0
        while network.now_s() < until_s:
            yield from self._passing(0.1)
            for event in network.events[seen:]:
                if event.kind is kind and network.nodes[event.node].antenna.powered:
                    yield from self._passing(after_s)
                    self._kill([event.node])
                    return
            seen = len(network.events)


def _drawn(scenario: Scenario, rng: random.Random) -> Scenario:
    sequence = scenario.sequence
    assert sequence is not None
    if scenario.radio.kind != "disc":
        raise ConfigurationError("a sequence needs the disc radio")
    drones = rng.randint(*sequence.drones)
    area_m2 = drones * math.pi * scenario.range_m**2 / (rng.uniform(*sequence.density) + 1.0)
    return scenario.model_copy(
        update={
            "layout": Layout(
                kind="uniform",
                drones=drones,
                width_m=math.sqrt(area_m2),
                least_distance_m=LEAST_DISTANCE_M,
                gateway_at="random",
            ),
            "radio": Radio(loss=rng.choice((0.0, 0.0, 0.02, 0.05))),
            "grounded_share": rng.choice((0.0, 0.0, 0.1, 0.3)),
        }
    )
