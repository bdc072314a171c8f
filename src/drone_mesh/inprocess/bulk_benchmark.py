"""Throughput over some hops: `python3 -m drone_mesh.inprocess.bulk_benchmark --help`."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Sequence

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.communication.data.packets import MAX_MESSAGE_BYTES
from drone_mesh.errors import QueueFull
from drone_mesh.inprocess.network import Network
from drone_mesh.inprocess.wall_mesh import WallMesh
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.settings import RadioSettings

SPACING_M = 8.0
CONNECT_WITHIN_S = 60.0
SETTLE_S = 3.0
FEED_PERIOD_S = 0.1  # how often the sender's queue is filled
SEED = 1


def emulated(hops: int, seconds: float) -> float:
    """Kilobits per second in emulated time, which waits for every step."""
    network = Network(seed=SEED, radio="chips")
    for node in range(hops + 1):
        (network.add_router if node else network.add_gateway)(node, SPACING_M * node, 0.0)
    network.run_until(network.all_connected, CONNECT_WITHIN_S)
    network.run_for(SETTLE_S)
    begun_s = network.now_s()
    while network.now_s() - begun_s < seconds:
        try:
            while True:
                network.send(hops, 0, bytes(MAX_MESSAGE_BYTES))
        except QueueFull:
            network.run_for(FEED_PERIOD_S)
    arrived = len(network.received.get(0, []))
    return _kbit_per_s(arrived, network.now_s() - begun_s)


def in_real_time(hops: int, seconds: float) -> float:
    """The same with the threads of real nodes, which wait for the processor."""
    mesh = WallMesh(IdealDisc(MAX_DISTANCE_M), RadioSettings(), SEED)
    for node in range(hops + 1):
        mesh.add(node, SPACING_M * node, 0.0, gateway=node == 0)
    deadline_s = mesh.now_s() + CONNECT_WITHIN_S
    while not mesh.all_connected() and mesh.now_s() < deadline_s:
        mesh.run_for(FEED_PERIOD_S)
    mesh.run_for(SETTLE_S)
    arrived: list[object] = []
    mesh.components[0].data.on_received(arrived.append)

    def feed(now_s: float) -> None:
        try:
            while True:
                mesh.components[hops].data.send(0, bytes(MAX_MESSAGE_BYTES), now_s)
        except QueueFull:
            pass  # it has enough to do

    begun_s = time.monotonic()
    while time.monotonic() - begun_s < seconds:
        mesh.submit(feed)
        mesh.run_for(FEED_PERIOD_S)
    rate = _kbit_per_s(len(arrived), time.monotonic() - begun_s)
    mesh.stop()
    return rate


def _kbit_per_s(messages: int, seconds: float) -> float:
    return messages * MAX_MESSAGE_BYTES * 8e-3 / seconds


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each number of hops."""
    parser = argparse.ArgumentParser(
        prog="drone_mesh.inprocess.bulk_benchmark",
        description="The last node of a row on emulated chips sends messages of "
        f"{MAX_MESSAGE_BYTES} bytes to the gateway, as fast as it can.",
    )
    parser.add_argument("--hops", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--seconds", type=float, default=10.0, help="measured; %(default)s")
    parser.add_argument("--wall", action="store_true", help="in real time")
    parsed = parser.parse_args(arguments)
    for hops in parsed.hops:
        rate = (in_real_time if parsed.wall else emulated)(hops, parsed.seconds)
        print(f"{hops} hops: {rate:.1f} kbit/s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
