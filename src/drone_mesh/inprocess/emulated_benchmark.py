"""The speed of the emulator: `python3 -m drone_mesh.inprocess.emulated_benchmark --help`."""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.arguments import MOST, whole
from drone_mesh.drone.fleet import MAX_DRONES, plan_fleet
from drone_mesh.inprocess.chip_air import ChipAir
from drone_mesh.inprocess.network import Network
from drone_mesh.inprocess.wall_mesh import WallMesh
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance
from drone_mesh.nrf24.emulator.measured import measured_curve
from drone_mesh.nrf24.emulator.trace import FrameTrace
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.settings import DATA_RATES, DEFAULT_RATE, RadioSettings

MESSAGE_BYTES = 16
PROGRESS_S = 5.0  # of wall time
MESSAGE_PERIOD_S = 1.0
ANSWER_WITHIN_S = 30.0  # after the last message
MENDED_WITHIN_S = 300.0


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="drone_mesh.inprocess.emulated_benchmark",
        description="Runs a mesh of real drivers on emulated chips, one gateway and routers on a "
        "grid, and prints how fast the emulation is.",
    )
    parser.add_argument(
        "--nodes",
        type=whole(0, MOST),
        default=17,
        help=f"number of nodes, 2..{MAX_DRONES} (default %(default)s)",
    )
    parser.add_argument(
        "--spacing",
        type=float,
        default=6.0,
        help="spacing of the grid in metres (default %(default)g)",
    )
    parser.add_argument(
        "--rate",
        choices=DATA_RATES,
        default=DEFAULT_RATE,
        help="data rate in bits per second (default %(default)s)",
    )
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="simulated seconds (default %(default)g)"
    )
    parser.add_argument(
        "--seed",
        type=whole(0, MOST),
        default=1,
        help="seed of all random choices (default %(default)s)",
    )
    parser.add_argument(
        "--links",
        choices=("disc", "distance", "measured"),
        default="disc",
        help="loss: disc: none within 9 m; distance: growing with distance, edge at 9 m; measured: "
        "as measured in 2019, scaled to 9 m (default %(default)s)",
    )
    parser.add_argument(
        "--messages",
        type=int,
        default=0,
        help="then send this many reliable messages of 16 bytes, one a second, from random routers "
        "to the gateway, and print what arrives, and when",
    )
    parser.add_argument(
        "--death",
        action="store_true",
        help="then switch off the router that most paths lead through, and print how soon all "
        "others are connected again",
    )
    parser.add_argument(
        "--wall", action="store_true", help="run in real time and print how late the emulator is"
    )
    parser.add_argument(
        "--trace", type=Path, help="write the last 100000 frames to this pcapng file"
    )
    arguments = parser.parse_args(argv)
    if not 2 <= arguments.nodes <= MAX_DRONES:
        parser.error(f"--nodes must be 2 to {MAX_DRONES}")
    for name in ("spacing", "seconds"):
        if not getattr(arguments, name) > 0:
            parser.error(f"--{name} must be above 0")
    if arguments.wall and (arguments.messages or arguments.death):
        parser.error("--messages and --death need emulated time: leave --wall out")
    return arguments


def _links(name: str, rng: random.Random, bits_per_s: int) -> LinkModel:
    if name == "distance":
        return LogDistance.with_edge_at(MAX_DISTANCE_M, rng, bits_per_s=bits_per_s)
    if name == "measured":
        return measured_curve(rng, range_m=MAX_DISTANCE_M)
    return IdealDisc(MAX_DISTANCE_M)


@dataclass(frozen=True)
class _Bench:
    """The mesh under test, in virtual or real time."""

    mesh: Network | WallMesh
    air: Air
    antennas: list[NRF24HighLevelInterface]
    chips: list[EmulatedChip]


def _bench(arguments: argparse.Namespace) -> _Bench:
    settings = RadioSettings(data_rate=DATA_RATES[arguments.rate])
    rng = random.Random(f"{arguments.seed} links")
    links = _links(arguments.links, rng, settings.data_rate.value)
    routers = arguments.nodes - 1
    fleet = (1, routers, max(1, round(routers**0.5)), arguments.spacing)
    if arguments.wall:
        wall = WallMesh(links, settings, arguments.seed)
        for place in plan_fleet(*fleet):
            wall.add(place.node_id, place.longitude, place.latitude, gateway=place.node_id == 0)
        return _Bench(wall, wall.air, wall.antennas, wall.chips)
    network = Network(arguments.seed, radio="chips", rate=arguments.rate, links=links)
    network.add_fleet(*fleet)
    assert isinstance(network.air, ChipAir)
    antennas = list(network.air.antennas.values())
    return _Bench(network, network.air.air, list(antennas), [one.chip for one in antennas])


def main(argv: list[str] | None = None) -> int:
    """Run it and print the result."""
    arguments = _arguments(argv)
    started, cpu_started = time.perf_counter(), time.process_time()
    bench = _bench(arguments)
    mesh = bench.mesh
    trace = FrameTrace()
    if arguments.trace:
        bench.air.observe(trace.see)
    begin_s = mesh.now_s()
    connected_s = None
    rest_s, frames_before = begin_s, bench.air.frames  # at rest from then on
    shown = started
    try:
        while mesh.now_s() - begin_s < arguments.seconds:
            mesh.run_for(0.1)
            if connected_s is None and mesh.all_connected():
                rest_s, frames_before = mesh.now_s(), bench.air.frames
                connected_s = rest_s - begin_s
            if time.perf_counter() - shown > PROGRESS_S:
                shown = time.perf_counter()
                print(f"{mesh.now_s() - begin_s:.0f} of {arguments.seconds:g} s", file=sys.stderr)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    simulated_s = mesh.now_s() - begin_s
    wall_s, cpu_s = time.perf_counter() - started, time.process_time() - cpu_started
    _report(bench, simulated_s, wall_s, cpu_s, connected_s)
    frames_s = (bench.air.frames - frames_before) / max(mesh.now_s() - rest_s, 1e-9)
    print(f"frames once connected         {frames_s:.1f} per s")
    if isinstance(mesh, Network):
        if arguments.messages:
            print(_send_messages(mesh, arguments.messages, arguments.seed))
        if arguments.death:
            print(_switch_off_a_relay(mesh))
    else:
        print(f"events were late by at most   {mesh.clock.latest_ns / 1e6:.1f} ms")
    mesh.stop()
    if arguments.trace:
        try:
            written = trace.write(arguments.trace)
        except OSError as error:
            print(f"--trace {arguments.trace}: {error.strerror}", file=sys.stderr)
            return 1
        print(f"{written} frames written to {arguments.trace}")
    return 0


def _send_messages(network: Network, count: int, seed: int) -> str:
    rng = random.Random(f"{seed} messages")
    sent_s: dict[bytes, float] = {}
    for number in range(count):
        sender = rng.choice(sorted(set(network.nodes) - {0}))
        payload = number.to_bytes(MESSAGE_BYTES, "little")
        sent_s[payload] = network.now_s()
        network.send(sender, 0, payload)
        network.run_for(MESSAGE_PERIOD_S)
    network.run_for(ANSWER_WITHIN_S)
    received = network.received.get(0, [])
    delays_ms = sorted(1e3 * (one.received_s - sent_s[one.payload]) for one in received)
    text = f"messages that arrived         {len(delays_ms)} of {count}"
    if delays_ms:
        median, late = (delays_ms[int(share * (len(delays_ms) - 1))] for share in (0.5, 0.95))
        text += f"; delay p50 {median:.0f} ms, p95 {late:.0f} ms, longest {delays_ms[-1]:.0f} ms"
    return text


def _switch_off_a_relay(network: Network) -> str:
    if all(hops < 2 for hops in network.shortest_hops().values()):
        return "no router is a relay: none is switched off"
    paths = [network.path_to_gateway(node) or [] for node in network.nodes]
    dead = Counter(relay for path in paths for relay in path[1:-1]).most_common(1)[0][0]
    begun_s = network.now_s()
    cut = [node for node in network.nodes if dead in (network.path_to_gateway(node) or ())]
    network.power(dead, False)

    def mended() -> bool:
        return all(
            network.connected(node) and dead not in (network.path_to_gateway(node) or [dead])
            for node in network.nodes
            if node != dead
        )

    if not network.run_until(mended, MENDED_WITHIN_S):
        return f"after the death of node {dead}  not mended within {MENDED_WITHIN_S:g} s"
    took_s = network.now_s() - begun_s
    behind = len(cut) - 1
    return f"after the death of node {dead:<5} the {behind} behind it connected in {took_s:.1f} s"


def _report(
    bench: _Bench, simulated_s: float, wall_s: float, cpu_s: float, connected_s: float | None
) -> None:
    radios = [antenna.statistics() for antenna in bench.antennas]
    sent = sum(radio.sent for radio in radios)
    lost = sum(radio.lost for radio in radios)
    packets = sent + sum(radio.broadcasts for radio in radios)
    misuses = sum(len(chip.warnings) for chip in bench.chips)
    when = "never" if connected_s is None else f"{connected_s:.1f} s"
    print(f"nodes                         {len(bench.chips)}")
    print(f"all connected after           {when}")
    print(f"simulated                     {simulated_s:.1f} s")
    print(f"took                          {wall_s:.2f} s, {cpu_s:.2f} s of one core")
    print(f"simulated s per wall s        {simulated_s / wall_s:.1f}")
    print(f"simulated s per core s        {simulated_s / max(cpu_s, 1e-9):.1f}")
    print(f"packets (sent and broadcast)  {packets}, {packets / simulated_s:.1f} per s")
    print(f"of these sent and lost        {lost} of {sent}")
    print(f"frames, collisions            {bench.air.frames}, {bench.air.collisions}")
    print(f"cost per packet               {cpu_s / max(packets, 1) * 1e6:.0f} us")
    print(f"cost per frame                {cpu_s / max(bench.air.frames, 1) * 1e6:.0f} us")
    print(f"misuse of chips               {misuses}")


if __name__ == "__main__":
    sys.exit(main())
