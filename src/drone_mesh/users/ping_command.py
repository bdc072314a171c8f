"""The program mesh_ping."""

from __future__ import annotations

import time
from functools import partial
from typing import Sequence

from drone_mesh.communication.data.packets import MAX_DATA_PORT
from drone_mesh.communication.observer import in_hops
from drone_mesh.stopping import ends_as
from drone_mesh.users import command_line
from drone_mesh.users.local_client import LocalClient, Refused


@ends_as("mesh_ping")
def main(arguments: Sequence[str] | None = None) -> int:
    """Send echo requests to a node; the exit status is 1 if none was answered."""
    parser = command_line.parser_for(
        "mesh_ping", "Sends echo requests to a node and prints round trip, hops and loss."
    )
    command_line.add_echo_arguments(parser)
    parser.add_argument(
        "-c",
        "--count",
        type=command_line.count,
        help="number of requests (default: until Ctrl-C)",
    )
    parser.add_argument(
        "-i",
        "--interval",
        type=command_line.seconds,
        default=1.0,
        metavar="SECONDS",
        help="time between two requests (default: %(default)g)",
    )
    parser.add_argument(
        "-s",
        "--size",
        type=command_line.size,
        metavar="BYTES",
        help="instead, send reliable messages of this size, and time their acknowledgements; "
        f"programs on the node receive them on port {MAX_DATA_PORT}",
    )
    parsed = parser.parse_args(arguments)
    round_trips_s: list[float] = []
    asked = 0

    @ends_as("mesh_ping")
    def work() -> int:
        nonlocal asked
        node = command_line.client(parsed)
        while parsed.count is None or asked < parsed.count:
            if asked:
                time.sleep(parsed.interval)
            ask = _ask if parsed.size is None else partial(_ask_with, b"\0" * parsed.size)
            ask(node, parsed.id, asked + 1, parsed.timeout, round_trips_s)
            asked += 1
        return 0 if round_trips_s else 1

    status = work()
    if asked:
        print(_summary(asked, round_trips_s))
        status = 0 if round_trips_s else 1
    return status


def _ask(
    node: LocalClient, to: int, number: int, timeout_s: float, round_trips_s: list[float]
) -> None:
    try:
        answer = node.echo(to, timeout_s)
    except Refused as error:
        print(f"node {to}: number {number}: {error}", flush=True)
        return
    if not answer["answered"]:
        print(f"node {to}: number {number}: no answer within {timeout_s:g} s", flush=True)
        return
    round_trips_s.append(answer["round_trip_s"])
    milliseconds, hops = 1e3 * answer["round_trip_s"], answer["hops"]
    print(f"node {to}: number {number}, {in_hops(hops)}, {milliseconds:.1f} ms", flush=True)


def _ask_with(
    payload: bytes,
    node: LocalClient,
    to: int,
    number: int,
    timeout_s: float,
    round_trips_s: list[float],
) -> None:
    begun_s = time.monotonic()
    try:
        arrived, ticket = node.send(to, payload, port=MAX_DATA_PORT, wait_s=timeout_s)
    except Refused as error:
        arrived, ticket = False, str(error)
    took_s = time.monotonic() - begun_s
    if arrived:
        round_trips_s.append(took_s)
        ticket = f"{len(payload)} bytes, {1e3 * took_s:.1f} ms"
    print(f"node {to}: number {number}, {ticket}", flush=True)


def _summary(asked: int, round_trips_s: list[float]) -> str:
    lost = 100 * (asked - len(round_trips_s)) / asked
    words = f"{asked} sent, {len(round_trips_s)} answered, {lost:.0f} % lost"
    if round_trips_s:
        mean = sum(round_trips_s) / len(round_trips_s)
        figures = "/".join(f"{1e3 * s:.1f}" for s in (min(round_trips_s), mean, max(round_trips_s)))
        words += f"; round trip min/mean/max {figures} ms"
    return words
