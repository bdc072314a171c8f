"""The same moving nodes and messages in drone_mesh, ns-3 and gradysim, side by side.

motion: as ns-3's example manet-routing-compare: 50 nodes in 300 x 1500 m on random waypoints at up
to 20 m/s, and from 100 s on ten flows of four messages of 64 bytes a second. speed: 100 nodes in
60 x 60 m at 0.3 m/s, with a range of 9 m; 20 of them send two messages a second to node 0. All
follow the same BonnMotion traces, with the same range.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Iterator, NamedTuple, Sequence

import numpy as np
from bench import head, row, say
from scipy.sparse.csgraph import connected_components

from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.errors import MeshError
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.radio import HOP_DELAY_S
from drone_mesh.mobility import Area, Mobility, Track, tracks_of
from drone_mesh.mobility.trace_files import Knots, read_trace

BUILD = Path(__file__).resolve().parents[1] / "build"
EXAMPLE_DBM = 7.5  # the power of ns-3's example
EXAMPLE_M = 137.0  # its range: beyond, ns-3 notices no frame (Friis at its 5.15 GHz, -82 dBm)
SIZE = 64  # bytes of a message
PROMPT_S = 2.0  # no message is sent in the last seconds of a run
PILOTED = "its pilot flies it"  # a repair flight would leave the trace


class Scenario(NamedTuple):
    """The nodes' motion, their range, and the flows of messages."""

    nodes: int
    area: Area
    speed_m_s: tuple[float, float]
    steady: bool  # whether the random waypoints start in their steady state
    range_m: float
    flows: Sequence[tuple[int, int]]  # from, to
    from_s: float
    period_s: float
    until_s: float

    def starts(self) -> Iterator[tuple[int, int, float]]:
        """From, to and the first time of each flow."""
        for number, flow in enumerate(self.flows):
            yield (*flow, self.from_s + self.period_s * number / len(self.flows))

    def messages(self) -> list[tuple[int, int, float]]:
        """From, to and time of each message."""
        end_s = self.until_s - PROMPT_S
        return [
            (source, sink, start_s + number * self.period_s)
            for source, sink, start_s in self.starts()
            for number in range(math.ceil((end_s - start_s) / self.period_s))
        ]


FLOWS = [(10 + sink, sink) for sink in range(10)]
TO_ONE = [(source, 0) for source in range(1, 21)]
SCENARIOS = {
    "motion": Scenario(
        50, Area(0, 0, 300, 1500), (0.01, 20.0), False, EXAMPLE_M, FLOWS, 100.0, 0.25, 200.0
    ),
    "speed": Scenario(100, Area(0, 0, 60, 60), (0.3, 0.3), True, 9.0, TO_ONE, 20.0, 10.0, 80.0),
}
OURS = ("beacon", "child_table_tree")
ARMS = {  # simulator, routing, radio
    "motion": [
        *(("ns-3", routing, "802.11b") for routing in ("AODV", "OLSR", "DSDV")),
        *(("drone_mesh", routing, f"shared {rate}") for rate in ("250k", "2M") for routing in OURS),
    ],
    "speed": [
        ("gradysim", "40 lines", "disc"),
        *(("ns-3", routing, "802.11b") for routing in ("AODV", "OLSR")),
        *(("drone_mesh", routing, radio) for radio in ("disc", "shared 250k") for routing in OURS),
    ],
}


def drawn(scenario: Scenario, seed: int) -> str:
    """Random waypoints as a file of BonnMotion."""
    rng = random.Random(f"{seed} places")
    places = {node: scenario.area.point(rng, 0.0) for node in range(scenario.nodes)}
    steady = scenario.steady
    mobility = Mobility("random_waypoint", scenario.speed_m_s, gateways=True, steady=steady)
    lines = ["#2D"]
    for track in tracks_of(mobility, places, {0}, scenario.area, seed).values():
        knots, at_s = [(0.0, *track.position_at(0.0))], 0.0
        while at_s < scenario.until_s:
            leg = track.leg_at(at_s)
            at_s = leg.end_s
            knots.append((at_s, *leg.end))
        lines.append(" ".join(f"{t:.3f} {x:.3f} {y:.3f}" for t, x, y, _z in knots))
    return "\n".join(lines)


def waypoints(knots: Knots) -> Iterator[str]:
    """The lines for compare_ns3.cc: ns-3 takes each time once."""
    for node, places in knots.items():
        last_s = -math.inf
        for t, x, y, _z in places:
            if t > last_s:
                yield f"w {node} {t:.6f} {x:.6f} {y:.6f}"
            last_s = t


class Job(NamedTuple):
    """A scenario with one trace."""

    scenario: Scenario
    knots: Knots
    seed: int

    def tracks(self) -> dict[int, Track]:
        """The motion of each node."""
        places = {node: (x, y, z) for node, ((_t, x, y, z), *_rest) in self.knots.items()}
        mobility = Mobility("trace", knots=self.knots)
        return tracks_of(mobility, places, {0}, self.scenario.area, self.seed)

    def degree_and_reachable(self) -> tuple[float, float]:
        """Neighbours of a node, and the share of messages with a path in the second they leave."""
        tracks, degrees, reachable = self.tracks(), [], []
        for second in range(int(self.scenario.from_s), int(self.scenario.until_s - PROMPT_S)):
            places = np.array([tracks[node].position_at(second) for node in sorted(tracks)])
            apart_m = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
            near = apart_m < self.scenario.range_m  # itself, too
            degrees.append(near.sum() / len(places) - 1)
            _count, part = connected_components(near)
            reachable += [part[source] == part[sink] for source, sink in self.scenario.flows]
        return float(np.mean(degrees)), float(np.mean(reachable))


class Outcome(NamedTuple):
    """What a run did."""

    delays_s: Sequence[float]  # of the messages that arrived
    frames: float  # sent, acknowledgements included; nan: the radio has none
    core_s: float


def drone_mesh(job: Job, routing: str, radio: str) -> Outcome:
    """Node 0 is the gateway."""
    scenario, messages = job.scenario, job.scenario.messages()
    kind, _, rate = radio.partition(" ")
    network = Network(
        job.seed, routing=routing, radio=kind, rate=rate or "250k",
        max_distance_m=scenario.range_m, repair_options=RepairOptions(range_m=scenario.range_m),
    )  # fmt: skip
    tracks = job.tracks()
    for node, track in tracks.items():
        x, y, _z = track.position_at(0.0)
        if node:
            network.add_router(node, x, y, why_not_fly=PILOTED)
        else:
            network.add_gateway(node, x, y)
    network.fly(tracks)

    def send(number: int) -> None:
        source, sink, _at_s = messages[number]
        try:
            network.send(source, sink, number.to_bytes(SIZE, "big"), reliable=False)
        except MeshError:  # its queue is full: the message is lost
            return

    for number, (_source, _sink, at_s) in enumerate(messages):
        network.clock.call_at(at_s, send, number)
    begun_s = time.process_time()
    network.run_for(scenario.until_s)
    core_s = time.process_time() - begun_s
    network.stop()
    delays_s = [
        message.received_s - messages[int.from_bytes(message.payload, "big")][2]
        for received in network.received.values()
        for message in received
    ]
    return Outcome(delays_s, getattr(network.air, "frames", math.nan), core_s)


def ns3(job: Job, routing: str, _radio: str) -> Outcome:
    """In a process of its own, with the example's power or one that gives the wanted range."""
    scenario = job.scenario
    dbm = EXAMPLE_DBM + 20 * math.log10(scenario.range_m / EXAMPLE_M)  # Friis
    end_s = scenario.until_s - PROMPT_S
    lines = [f"{routing} {job.seed} {scenario.until_s} {dbm} {len(job.knots)}"]
    for source, sink, start_s in scenario.starts():
        lines.append(f"f {source} {sink} {start_s} {end_s} {scenario.period_s} {SIZE}")
    lines += waypoints(job.knots)
    command, given = [str(BUILD / "compare_ns3")], "\n".join(lines)
    ended = subprocess.run(command, input=given, capture_output=True, text=True, check=False)
    if ended.returncode:
        sys.exit(f"compare: ns-3: {ended.stderr.strip()[-500:]}")
    frames, core_s, *delays_s = map(float, ended.stdout.split())
    return Outcome(delays_s, frames, core_s)


def gradysim(job: Job, _routing: str, _radio: str) -> Outcome:
    """On its ideal disc."""
    from compare_gradysim import run  # gradysim is no part of .venv

    messages = job.scenario.messages()
    random.seed(job.seed)
    arrived, core_s = run(
        job.knots, messages, job.scenario.range_m, HOP_DELAY_S, job.scenario.until_s
    )
    return Outcome(
        [at_s - messages[number][2] for number, at_s in arrived.items()], math.nan, core_s
    )


COLUMNS = (
    *("simulator", "routing", "radio", "delivered", f"within {PROMPT_S:g} s", "median delay (ms)"),
    *("frames per node and s", "simulated s per core s"),
)
RUN = {"drone_mesh": drone_mesh, "ns-3": ns3, "gradysim": gradysim}


def cells(jobs: Sequence[Job], outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Of one arm: delivered, at all and promptly, delay, frames and speed."""
    sent = sum(len(job.scenario.messages()) for job in jobs)
    delays_s = [delay_s for one in outcomes for delay_s in one.delays_s]
    for within_s in (math.inf, PROMPT_S):
        yield f"{100 * sum(delay_s <= within_s for delay_s in delays_s) / sent:.1f} %"
    yield f"{1000 * statistics.median(delays_s):.3g}" if delays_s else ""
    until_s = jobs[0].scenario.until_s
    frames = sum(one.frames for one in outcomes) / sum(len(job.knots) * until_s for job in jobs)
    yield "" if math.isnan(frames) else f"{frames:.1f}"
    yield f"{statistics.median(until_s / one.core_s for one in outcomes):.3g}"


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(prog="scripts/compare", description=__doc__)
    parser.add_argument("scenario", choices=sorted(SCENARIOS))
    parser.add_argument("--traces", type=int, choices=range(1, 100), default=3, metavar="N")
    options = parser.parse_args()
    name, scenario, jobs = options.scenario, SCENARIOS[options.scenario], []
    for seed in range(1, options.traces + 1):
        path = BUILD / f"compare_{name}_{seed}.bonnmotion"
        path.write_text(drawn(scenario, seed), encoding="utf-8")
        jobs.append(Job(scenario, read_trace(path), seed))
    degree, reachable = map(statistics.fmean, zip(*(job.degree_and_reachable() for job in jobs)))
    title = (
        f"{name}: {scenario.nodes} nodes, range {scenario.range_m:g} m, {degree:.1f} neighbours; "
        f"{100 * reachable:.1f} % of the messages have a path when they leave"
    )
    head(title, *COLUMNS)
    for simulator, routing, radio in ARMS[name]:
        outcomes = []
        for job in jobs:
            say(f"{name}: {simulator}, {routing}, {radio}, trace {job.seed} of {len(jobs)}")
            outcomes.append(RUN[simulator](job, routing, radio))
        row(simulator, routing, radio, *cells(jobs, outcomes))


if __name__ == "__main__":
    main()
