"""One run: a network under a virtual clock, its faults, and its record."""

from __future__ import annotations

import contextlib
import hashlib
import math
from dataclasses import replace
from typing import Callable, Iterator, Protocol, cast

import numpy as np

from drone_mesh.air.graph import Graph
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.radio import InProcessAir
from drone_mesh.lab.endurance import EnduranceRun, with_spares
from drone_mesh.lab.flights import Flights
from drone_mesh.lab.formations import ToldPilots, tracks
from drone_mesh.lab.impairments import Impairments, OneWay
from drone_mesh.lab.metrics import STACKED_M
from drone_mesh.lab.network_sample import (
    LinkWatch,
    NetworkSample,
    gateways_of,
    physical_graph,
    route_hops,
    sample_of,
)
from drone_mesh.lab.probes import ProbeSender
from drone_mesh.lab.record import AirFigures, Place, RunRecord, ServiceGap, Topology
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.scenario_network import (
    ChannelAir,
    network_of,
    obstacles_of,
    places_of,
    put_obstacles,
)
from drone_mesh.lab.timeline import Timeline
from drone_mesh.mobility import Track
from drone_mesh.state.model import MeshStatus
from drone_mesh.state.observation import describe_obstacles

FLIGHT_SAMPLE_S = 0.25  # period of distance checks while a drone flies: 0.5 m at 2 m/s

ABLE_WITHIN_M = 1.0  # a gateway counts as reachable up to this far inside the range

OnStatus = Callable[[MeshStatus], None]


class Simulation:
    """A run of a mesh with packets. Create it, call `run()` once, and read its record."""

    def __init__(self, scenario: Scenario, streams: Streams) -> None:
        """Raises ConfigurationError for a layout that cannot be drawn."""
        self.scenario = scenario
        places = layout = places_of(scenario, streams)
        if scenario.endurance is not None:
            places = with_spares(scenario.endurance, layout)
        one_way = OneWay(scenario, streams)
        self.network = network_of(scenario, streams, places, one_way)
        self.impairments = Impairments(
            self.network, streams.generator, scenario.radio.loss, one_way
        )
        put_obstacles(self.network, self.impairments, scenario)
        self.flights = Flights(self.network)
        self.timeline = Timeline(
            scenario, self.network, self.impairments, self.flights, streams, self._observing
        )
        self._endurance = scenario.endurance and EnduranceRun(
            scenario.endurance, layout, self.network, self.timeline
        )
        self._move(tracks(scenario, places, streams))
        self._probes = ProbeSender(
            self.network, scenario.probes, scenario.duration_s, streams.generator("probes")
        )
        churns = any(fault.churn is not None for fault in scenario.faults)
        self._is_watched = bool(churns or scenario.probes.per_s or scenario.mobility.kind != "none")
        self._links = LinkWatch(scenario.probes.from_s if scenario.probes.per_s else 0.0)
        self._samples: list[NetworkSample] = []
        self._start_places = self._places()
        self._start: Topology | None = None
        self._before: Topology | None = None
        self._after_fault: Graph | None = None
        self._cut_off: dict[int, float] = {}  # node -> since when
        self._cut_offs: list[ServiceGap] = []  # that have ended
        self._pairs: set[tuple[int, int]] = set()
        self._min_distance_m = math.inf

    def run(self, on_status: OnStatus | None = None) -> RunRecord:
        """Run to the end. `on_status` gets the state after each sample, for pictures."""
        boxes = describe_obstacles(obstacles_of(self.scenario).boxes)
        for _now_s in self.samples():
            if on_status is not None:
                on_status(replace(self.network.status(), obstacles=boxes))
        return self.record()

    def samples(self) -> Iterator[float]:
        """Let time pass until the end; yields the time (s) of each sample once it is taken."""
        return self.sampled_until(self.scenario.duration_s)

    def sampled_until(self, end_s: float) -> Iterator[float]:
        """Let time pass until `end_s`; yields the time of each sample."""
        clock = self.network.clock
        start_s, step = clock.now_s, 0
        while clock.now_s < end_s:
            step += 1
            self._pass_time(min(end_s, start_s + step * self.scenario.sample_s))
            sample = self._take_sample()
            if self._start is None:
                self._start = self._scene(sample)._replace(places=self._start_places)
            self.timeline.check(sample)
            yield clock.now_s

    def record(self) -> RunRecord:
        """The record, once all samples are taken. The network stops."""
        record = self.record_so_far()
        self.network.stop()
        return record

    def record_so_far(self) -> RunRecord:
        """The record up to the latest sample, of which there must be one; to be read at once."""
        network, scenario, nodes = self.network, self.scenario, self.network.nodes
        assert self._start is not None  # a run has at least one sample
        able = frozenset(filter(self.is_able, nodes))
        return RunRecord(
            scenario=scenario,
            gateways=frozenset(gateways_of(network)),
            start=self._start,
            before=self._before,
            after_fault=self._after_fault,
            end=self._scene(self._samples[-1]),
            fault_s=self.timeline.first_disruption_s,
            samples=self._samples,
            happened=self.timeline.happened,
            events=network.event_records(),
            legs=self.flights.legs,
            traffic=self.impairments.traffic,
            orders=self.timeline.orders,
            messages=self.timeline.messages,
            received=[
                message
                for gateway in gateways_of(network)
                for message in network.received.get(gateway, ())
                if message.received_s >= self.timeline.messages_since_s
            ],
            messages_since_s=self.timeline.messages_since_s,
            collisions=len(self._pairs),
            min_distance_m=self._min_distance_m,
            end_s=network.clock.now_s,
            air=_air_figures(network),
            links=self._links,
            probes=self._probes.results(),
            frames=self.impairments.frames,
            formations=self.timeline.formations,
            endurance=self._endurance.finished() if self._endurance else None,
            refused_flights=sum(node.drone.refused for node in nodes.values()),
            cut_offs=[*self._cut_offs, *(ServiceGap(*gap, None) for gap in self._cut_off.items())],
            in_the_air=frozenset(self.flights.in_the_air),
            grounded=frozenset(n for n, node in nodes.items() if node.drone.why_not_fly()),
            left_behind={
                n: node.component.get_repair_status().in_words(network.clock.now_s)
                for n, node in nodes.items()
                if not node.is_gateway and node.antenna.powered and not network.connected(n)
            },
            able=able,
            able_knowing=frozenset(filter(self.could_know_a_link, able)),
            informed=frozenset(
                n for n, node in nodes.items() if node.is_gateway or node.component.places.gateway
            ),
            endless_packets=sum(
                count
                for node in nodes.values()
                for reason, count in node.component.complaints.counts.items()
                if "too many hops" in reason
            ),
        )

    def _move(self, flown: dict[int, Track]) -> None:
        if self.scenario.mobility.told:
            ToldPilots(self.network, flown, self.timeline.send_order)
        elif flown:
            self.network.fly(flown)

    def event_hash(self) -> str:
        """A hash of all events of the mesh software: equal for equal runs."""
        digest = hashlib.sha256()
        for event in self.network.events:
            what = f"{event.kind.value} {event.peer} {event.explanation()}"
            digest.update(f"{event.now_s:.6f} {event.node} {what}\n".encode())
        return digest.hexdigest()[:16]

    def _pass_time(self, until_s: float) -> None:
        clock = self.network.clock
        while clock.now_s < until_s:
            if self.flights.in_the_air:
                clock.run_until(min(until_s, clock.now_s + FLIGHT_SAMPLE_S))
                self.flights.look()
                self._watch_distances()
            else:
                clock.run_until(until_s)

    def is_able(self, node: int) -> bool:
        """Whether a drone can fly and the gateway would be in range of its believed place."""
        network = self.network
        believed = network.nodes[node].component.places.gateway
        if believed is None or network.nodes[node].drone.why_not_fly():
            return False
        reach_m = self.scenario.range_m - ABLE_WITHIN_M
        return any(believed.distance_m(network.location(g)) < reach_m for g in gateways_of(network))

    def could_know_a_link(self, _node: int) -> bool:
        """Whether an able drone could know of a node with a path and a working link to it.

        The gateway is one.
        """
        return True

    def _take_sample(self) -> NetworkSample:
        sample = sample_of(self.network)
        self._samples.append(sample)
        if self._endurance:
            self._endurance.look(sample)
        if self._is_watched:
            self._links.look(sample, physical_graph(self.network), gateways_of(self.network))
        for node in self._cut_off.keys() & sample.served:
            self._cut_offs.append(ServiceGap(node, self._cut_off.pop(node), sample.now_s))
        return sample

    @contextlib.contextmanager
    def _observing(self) -> Iterator[None]:
        """Observe the network before and after what happens inside."""
        if self._before is None:
            self._before = self._scene(sample_of(self.network))
        yield
        graph = physical_graph(self.network)
        if self._after_fault is None:
            self._after_fault = graph
        with_path = graph.hops_from(gateways_of(self.network))
        if with_path:  # while no gateway is on, there is nothing that a repair could do
            for node in sorted(graph.near.keys() - with_path.keys()):
                self._cut_off.setdefault(node, self.network.clock.now_s)
        self._take_sample()

    def _places(self) -> dict[int, Place]:
        return {
            node_id: self.network.location(node_id).to_vector() for node_id in self.network.nodes
        }

    def _scene(self, sample: NetworkSample) -> Topology:
        hops = route_hops(self.network, sample.served)
        return Topology(physical_graph(self.network), hops, self._places())

    def _watch_distances(self) -> None:
        nodes = self.network.nodes
        live = [n for n, node in nodes.items() if node.antenna.powered]
        flying = [n for n in self.flights.in_the_air if nodes[n].antenna.powered]
        if not flying or len(live) < 2:
            return
        places = self._places()
        points = np.array([places[n] for n in live])
        for node in flying:
            distances = np.linalg.norm(points - places[node], axis=1)
            distances[live.index(node)] = math.inf
            self._min_distance_m = min(self._min_distance_m, float(distances.min()))
            for index in np.flatnonzero(distances < STACKED_M):
                other = live[index]
                self._pairs.add((min(node, other), max(node, other)))


class _Radio(Protocol):
    """The antenna of one of the radios that share a channel."""

    def statistics(self) -> RadioStatistics: ...


def _air_figures(network: Network) -> AirFigures | None:
    if isinstance(network.air, InProcessAir):
        return None
    air = cast(ChannelAir, network.air)
    radios = [cast(_Radio, node.antenna).statistics() for node in network.nodes.values()]
    return AirFigures(
        air.airtime_s,
        air.collisions,
        sent=sum(radio.sent for radio in radios),
        tries=sum(radio.sent + radio.tries for radio in radios),
        given_up=sum(radio.lost for radio in radios),
    )
