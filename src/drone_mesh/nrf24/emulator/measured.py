"""The range that was measured in 2019 with real modules, as a loss curve."""

from __future__ import annotations

import csv
import random
from collections import defaultdict
from pathlib import Path

from drone_mesh.nrf24.emulator.links import LossCurve

RANGE_FILE = Path(__file__).with_name("nrf24_range.csv")
_PACKETS_PER_RUN = 1000


def measured_losses(path: Path = RANGE_FILE) -> tuple[tuple[float, float], ...]:
    """Distance in metres and mean share of packets that were lost after all retries."""
    lost: defaultdict[float, list[int]] = defaultdict(list)
    with path.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            lost[float(row["distance_m"])].append(int(row["packets_lost_of_1000"]))
    return tuple(
        (distance_m, sum(runs) / len(runs) / _PACKETS_PER_RUN)
        for distance_m, runs in sorted(lost.items())
    )


def measured_curve(rng: random.Random, *, range_m: float | None = None) -> LossCurve:
    """The measured modules; with `range_m`, shrunk or stretched so that their range ends there."""
    points = measured_losses()
    scale = 1.0 if range_m is None else points[-1][0] / range_m
    return LossCurve(points, rng, metres_per_metre=scale)
