"""The record of one run, ready to be measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Mapping, NamedTuple, Sequence, Tuple

from drone_mesh.air.graph import Graph
from drone_mesh.communication.data.transport import ReceivedMessage
from drone_mesh.lab.endurance import EnduranceFigures
from drone_mesh.lab.flights import Leg
from drone_mesh.lab.formations import Formations
from drone_mesh.lab.impairments import Traffic
from drone_mesh.lab.network_sample import LinkWatch, NetworkSample
from drone_mesh.lab.probes import ProbeFate
from drone_mesh.lab.scenario import Scenario
from drone_mesh.lab.timeline import HandedIn, Happened, OrderAttempt
from drone_mesh.state.model import EventRecord

Place = Tuple[float, float, float]  # x, y, z in metres
HOLD_S = 5.0  # least uninterrupted service that counts as healed


class Topology(NamedTuple):
    """The network's topology at one moment."""

    graph: Graph  # of all nodes with power
    route_hops: Mapping[int, int]  # of each served router
    places: Mapping[int, Place]  # of all drones


@dataclass(frozen=True)
class ServiceGap:
    """A router's time without a working path to a gateway, as seen from outside."""

    node: int
    lost_s: float
    restored_s: float | None  # None: not until the end

    def seconds(self, end_s: float) -> float:
        """The duration of the gap; up to the end of the run if it has not ended."""
        return (end_s if self.restored_s is None else self.restored_s) - self.lost_s


class AirFigures(NamedTuple):
    """Totals of a channel that all radios share."""

    airtime_s: float  # of all frames
    destroyed: int  # receptions, by other frames
    sent: int  # packets that request an acknowledgement
    tries: int  # of these, by the driver
    given_up: int  # of these packets


@dataclass(frozen=True)
class RunRecord:
    """A finished run. Times are simulated seconds."""

    scenario: Scenario
    gateways: frozenset[int]
    start: Topology
    before: Topology | None  # right before the first fault that must be healed
    after_fault: Graph | None  # right after it
    end: Topology
    fault_s: float | None  # when it was
    samples: Sequence[NetworkSample]
    happened: Sequence[Happened]
    events: Sequence[EventRecord]
    legs: Sequence[Leg]
    traffic: Mapping[int, Traffic]  # by message type
    orders: Sequence[OrderAttempt]
    messages: Sequence[HandedIn]  # of users
    received: Sequence[ReceivedMessage]  # at the gateways
    messages_since_s: float  # from when on both count
    collisions: int
    min_distance_m: float  # of two drones that were not as close at the start; inf: not measured
    end_s: float
    air: AirFigures | None  # None: the disc, where packets never meet
    refused_flights: int
    cut_offs: Sequence[ServiceGap]  # of routers without any path to a gateway right after a fault
    in_the_air: frozenset[int]  # at the end
    grounded: frozenset[int]  # drones that cannot fly
    left_behind: Mapping[int, str]  # live routers that are not connected at the end -> why
    able: frozenset[int]  # drones that can fly and know roughly where a gateway is, at the end
    able_knowing: frozenset[int]  # of these, the ones that could know of a node with a link to them
    informed: frozenset[int]  # nodes that know a place of a gateway, at the end
    endless_packets: int  # dropped at the limit of hops
    links: LinkWatch  # empty in a run without motion, churn and probes
    probes: Sequence[ProbeFate]
    frames: Mapping[str, int] | None  # shared channel: "control" and "data"
    formations: Formations  # what became of layouts
    endurance: EnduranceFigures | None  # None: batteries do not count

    @property
    def healed_at_s(self) -> float | None:
        """The first time after the fault from which all live routers are served for HOLD_S.

        None: not before the end. A run without such a fault is healed from its start.
        """
        since_s: float | None = None
        for sample in self.samples:
            if self.fault_s is not None and sample.now_s < self.fault_s:
                continue
            if len(sample.served) < len(sample.alive):
                since_s = None
            else:
                if since_s is None:
                    since_s = sample.now_s
                if sample.now_s - since_s >= HOLD_S:
                    return since_s
        return None

    def gaps(self) -> list[ServiceGap]:
        """Each router's gaps in service since the fault, or since all were first served."""
        begin_s = self.fault_s
        if begin_s is None:
            begin_s = next((sample.now_s for sample in self.samples if sample.share == 1.0), None)
        if begin_s is None:
            return []
        open_since: dict[int, float] = {}
        gaps = []
        for sample in self.samples:
            if sample.now_s < begin_s:
                continue
            for node in sorted(open_since.keys() & sample.served):
                gaps.append(ServiceGap(node, open_since.pop(node), sample.now_s))
            for node in list(open_since):
                if node not in sample.alive:
                    del open_since[node]  # it died, so there is nothing left to repair
            for node in sorted(sample.alive - sample.served):
                open_since.setdefault(node, sample.now_s)
        gaps += [ServiceGap(node, since_s, None) for node, since_s in open_since.items()]
        return sorted(gaps, key=lambda gap: (gap.lost_s, gap.node))
