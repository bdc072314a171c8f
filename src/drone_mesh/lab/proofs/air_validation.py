"""The fast model of the air against the emulated chips.

`python3 -m drone_mesh.lab.proofs.air_validation`: docs/performance.md, "The model against
the chips".
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import time
from typing import NamedTuple, Sequence

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.inprocess.emulated_mesh import EmulatedMesh
from drone_mesh.inprocess.network import Network
from drone_mesh.inprocess.shared_air import SharedAir
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.cooperative_clock import CooperativeClock
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance
from drone_mesh.nrf24.settings import RadioSettings, data_rate

SIZES = (17, 26, 50, 101)
RATES = ("250k", "1M", "2M")
LINKS = ("disc", "distance")
# Times and collisions of single runs vary by a third of their mean: a mean over this many runs is
# accurate to a few percent. Runs of large meshes vary less and cost more.
SEEDS = {17: 40, 26: 40, 50: 20}
SEEDS_OF_OTHERS = 5
AFTER_S = 40.0
WITHIN_S = 180.0
SPACING_M = 6.0
# Limits of agreement.
SHARE_POINTS = 2.0
CONNECTED_PART = 0.25
FRAMES_PART = 0.10
COLLIDED_PART = 0.10


CHIPS, MODEL = "chips", "model"
SAMPLE_S = 0.1


class AirTrial(NamedTuple):
    """A gateway and routers on a grid."""

    nodes: int
    rate: str
    links: str
    seed: int


class TrialFigures(NamedTuple):
    """The result of one trial."""

    connected_s: float  # when all were connected for the first time; infinity: never
    share: float  # of node-seconds connected after that, without the gateway
    frames: int
    collided: float  # receptions that another frame destroyed, per frame
    simulated_s: float
    cpu_s: float


class Means(NamedTuple):
    """Means over several seeds."""

    connected_s: float
    share_percent: float
    frames_per_s: float
    collided_percent: float
    simulated_per_core_s: float

    @classmethod
    def of(cls, runs: Sequence[TrialFigures]) -> Means:
        """The means of these runs."""
        count = len(runs)
        return cls(
            sum(run.connected_s for run in runs) / count,
            100 * sum(run.share for run in runs) / count,
            sum(run.frames / run.simulated_s for run in runs) / count,
            100 * sum(run.collided for run in runs) / count,
            sum(run.simulated_s for run in runs) / max(sum(run.cpu_s for run in runs), 1e-9),
        )


def disagreements(chips: Means, model: Means) -> list[str]:
    """The figures for which the model is too far from the chips."""
    found = []
    if abs(model.share_percent - chips.share_percent) > SHARE_POINTS:
        found.append("share")
    if chips.connected_s == math.inf or model.connected_s == math.inf:
        if chips.connected_s != model.connected_s:
            found.append("time")
    elif abs(model.connected_s / chips.connected_s - 1) > CONNECTED_PART:
        found.append("time")
    if abs(model.frames_per_s / chips.frames_per_s - 1) > FRAMES_PART:
        found.append("frames")
    if abs(model.collided_percent / max(chips.collided_percent, 1e-9) - 1) > COLLIDED_PART:
        found.append("collided")
    return found


def watch(trial: AirTrial, kind: str, after_s: float) -> TrialFigures:
    """Wait until all are connected, then observe them for `after_s`."""
    cpu_s = time.process_time()
    mesh = _mesh(trial, kind)
    assert isinstance(mesh.air, (Air, SharedAir))
    routers, samples, connected = range(1, trial.nodes), round(after_s / SAMPLE_S), 0
    is_connected = mesh.run_until(mesh.all_connected, WITHIN_S)
    connected_s = mesh.now_s() if is_connected else math.inf
    for _ in range(samples if is_connected else 0):
        mesh.run_for(SAMPLE_S)
        connected += sum(map(mesh.connected, routers))
    frames, simulated_s = mesh.air.frames, mesh.now_s()
    if isinstance(mesh, EmulatedMesh):
        mesh.stop()
    return TrialFigures(
        connected_s,
        connected / (samples * len(routers)),
        frames,
        mesh.air.collisions / max(frames, 1),
        simulated_s,
        time.process_time() - cpu_s,
    )


def _mesh(trial: AirTrial, kind: str) -> EmulatedMesh | Network:
    links: LinkModel = IdealDisc(MAX_DISTANCE_M)
    rate, rng = data_rate(trial.rate), random.Random(f"{trial.seed} links")
    if trial.links == "distance":
        links = LogDistance.with_edge_at(MAX_DISTANCE_M, rng, bits_per_s=rate.value)
    fleet = plan_fleet(1, trial.nodes - 1, round((trial.nodes - 1) ** 0.5), SPACING_M)
    if kind == MODEL:
        network = Network(seed=trial.seed, radio="shared", rate=trial.rate, links=links)
        for place in fleet:
            add = network.add_router if place.node_id else network.add_gateway
            add(place.node_id, place.longitude, place.latitude)
        return network
    settings = RadioSettings(data_rate=rate)
    mesh = EmulatedMesh(CooperativeClock(), links, trial.seed, settings=settings)
    for place in fleet:
        put = mesh.add_router if place.node_id else mesh.add_gateway
        put(place.node_id, (place.longitude, place.latitude, 0.0))
    return mesh


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="drone_mesh.lab.proofs.air_validation",
        description="Runs the same meshes on emulated chips and on the fast model, and prints a "
        "table in Markdown: means over the seeds, chips / model. The exit status is 1 if "
        f"chips and model differ in a row: by more than {SHARE_POINTS:g} points in the share, "
        f"{100 * CONNECTED_PART:g} % in the time to all connected, or {100 * FRAMES_PART:g} % in "
        "the frames or the collided share.",
    )
    parser.add_argument("--nodes", type=int, nargs="+", default=SIZES, help="sizes of the meshes")
    parser.add_argument(
        "--rates", nargs="+", choices=RATES, default=RATES, help="data rates (default: all)"
    )
    parser.add_argument(
        "--links", nargs="+", choices=LINKS, default=LINKS, help="models of loss (default: both)"
    )
    seeds = ", ".join(f"{count} for {nodes} nodes" for nodes, count in SEEDS.items())
    parser.add_argument(
        "--seeds",
        type=int,
        help=f"number of seeds per row (default {seeds}, else {SEEDS_OF_OTHERS})",
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=AFTER_S,
        help="simulated time to observe after all are connected (default %(default)g)",
    )
    arguments = parser.parse_args(argv)
    if arguments.seeds is not None and arguments.seeds < 1:
        parser.error("--seeds must be 1 or more")
    if not arguments.seconds > 0:
        parser.error("--seconds must be above 0")
    return arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; returns 1 if a row disagrees."""
    arguments = _arguments(argv)
    names = "nodes | rate | links | seeds | all connected, s | connected, % | frames/s"
    names += " | collided, % | sim. s per core s | disagrees"
    print(f"| {names} |\n|{'---|' * (names.count('|') + 1)}", flush=True)
    wrong = 0
    try:
        for nodes in arguments.nodes:
            for rate in arguments.rates:
                for links in arguments.links:
                    trial = AirTrial(nodes, rate, links, seed=0)
                    seeds = arguments.seeds or SEEDS.get(nodes, SEEDS_OF_OTHERS)
                    wrong += _row(trial, seeds, arguments.seconds)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return int(wrong > 0)


def _row(trial: AirTrial, seeds: int, seconds: float) -> bool:
    runs: dict[str, list[TrialFigures]] = {CHIPS: [], MODEL: []}
    for seed in range(1, seeds + 1):
        print(f"{trial.nodes} nodes, {trial.rate}, {trial.links}: seed {seed}", file=sys.stderr)
        for kind in runs:
            runs[kind].append(watch(trial._replace(seed=seed), kind, seconds))
    chips, model = Means.of(runs[CHIPS]), Means.of(runs[MODEL])
    wrong = disagreements(chips, model)
    cells = [
        str(seeds),
        f"{chips.connected_s:.1f} / {model.connected_s:.1f}",
        f"{chips.share_percent:.2f} / {model.share_percent:.2f}",
        f"{chips.frames_per_s:.0f} / {model.frames_per_s:.0f}",
        f"{chips.collided_percent:.1f} / {model.collided_percent:.1f}",
        f"{chips.simulated_per_core_s:.0f} / {model.simulated_per_core_s:.0f}",
        ", ".join(wrong) or "no",
    ]
    print(f"| {trial.nodes} | {trial.rate} | {trial.links} | {' | '.join(cells)} |", flush=True)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
