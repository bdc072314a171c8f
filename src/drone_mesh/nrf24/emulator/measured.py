"""The range measured in 2019 with real modules, as a loss curve."""

from __future__ import annotations

import csv
import random
from collections import defaultdict
from pathlib import Path

from drone_mesh.nrf24.airtime import NS_PER_S, failed_cycle_ns
from drone_mesh.nrf24.emulator.links import LossCurve
from drone_mesh.nrf24.settings import RadioSettings

RANGE_FILE = Path(__file__).with_name("nrf24_range.csv")
_PACKETS_PER_RUN = 1000
_NEAR_M = 300.0  # up to this distance the throughput was constant


def measured_losses(path: Path = RANGE_FILE) -> tuple[tuple[float, float], ...]:
    """Distance in metres and mean share of packets lost after all retries."""
    return tuple(
        (distance_m, lost / _PACKETS_PER_RUN)
        for distance_m, lost in _means(path, "packets_lost_of_1000")
    )


def measured_frame_losses(path: Path = RANGE_FILE) -> tuple[tuple[float, float], ...]:
    """Distance in metres and the additional share of lost single frames.

    Derived from the throughput: packets took longer than near ones. Lost packets took the 16 frames
    of their bursts; the rest are retransmissions of packets that arrived.
    """
    settings = RadioSettings(crc_bytes=1)  # of 2019
    frame_ns = round(settings.frame_s * NS_PER_S)
    ard_ns = (settings.retransmit_delay + 1) * 250_000
    failed_s = failed_cycle_ns(frame_ns, ard_ns, settings.retransmits) / NS_PER_S
    retry_s = failed_cycle_ns(frame_ns, ard_ns, 1) / NS_PER_S / 2
    losses = dict(measured_losses(path))
    throughputs = _means(path, "throughput_kbit_s")
    near = [kbit_s for distance_m, kbit_s in throughputs if distance_m <= _NEAR_M]
    near_kbit_s = sum(near) / len(near)
    near_loss = sum(losses[m] for m, _ in throughputs if m <= _NEAR_M) / len(near)
    near_s = (1 - near_loss) * settings.acknowledged_s + near_loss * failed_s
    points = []
    for distance_m, kbit_s in throughputs:
        lost = losses[distance_m]
        packet_s = near_s * near_kbit_s / kbit_s
        left_s = packet_s - (1 - lost) * settings.acknowledged_s - lost * failed_s
        retries = max(left_s, 0.0) / (1 - lost) / retry_s
        points.append((distance_m, retries / (1 + retries)))
    return tuple(points)


def measured_curve(rng: random.Random, *, range_m: float | None = None) -> LossCurve:
    """The measured modules; with `range_m`, scaled so that their range ends there."""
    points = measured_losses()
    scale = 1.0 if range_m is None else points[-1][0] / range_m
    return LossCurve(points, rng, frame_points=measured_frame_losses(), metres_per_metre=scale)


def _means(path: Path, column: str) -> list[tuple[float, float]]:
    values: defaultdict[float, list[float]] = defaultdict(list)
    with path.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            values[float(row["distance_m"])].append(float(row[column]))
    return [(distance_m, sum(found) / len(found)) for distance_m, found in sorted(values.items())]
