"""The commands mesh_send, mesh_listen, mesh_ping and mesh_trace."""

from __future__ import annotations

import argparse
import base64
import json
import os
import sys
import time
from pathlib import Path
from typing import Any, Callable, Optional, Sequence, Tuple

from drone_mesh.arguments import MOST, decimal, whole
from drone_mesh.communication.data.outgoing import TO_ALL, TO_GATEWAY
from drone_mesh.communication.data.packets import MAX_DATA_PORT, MAX_MESSAGE_BYTES, check_size
from drone_mesh.communication.events.observer import in_hops
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.stopping import ends_as
from drone_mesh.users.local_client import NODE_VARIABLE, LocalClient, Refused, node_here

MOST_SECONDS = 86400.0  # a day

_node_id = whole(0, MAX_NODE_ID)
_port = whole(0, MAX_DATA_PORT)
_count = whole(1, MOST)
_size = whole(1, MAX_MESSAGE_BYTES)
_seconds = decimal(0.0, MOST_SECONDS)

_DESTINATIONS = {"all": TO_ALL, "gateway": TO_GATEWAY}

Probed = Tuple[Optional[float], str]
"""Seconds until the answer, None if there was none; and words that follow a number."""


@ends_as("mesh_send")
def send(arguments: Sequence[str] | None = None) -> int:
    """Send one message; the exit status is 1 if it was not delivered."""
    parser = _parser(
        "mesh_send", f"Sends a message of up to {MAX_MESSAGE_BYTES} bytes through the mesh."
    )
    parser.add_argument("to", type=_destination, metavar="TO", help='node id, "gateway" or "all"')
    parser.add_argument(
        "text", nargs="?", help="the message (default: the bytes on standard input)"
    )
    parser.add_argument(
        "--port",
        type=_port,
        default=0,
        help=f"port of the receiver, 0..{MAX_DATA_PORT} (default: %(default)s)",
    )
    parser.add_argument(
        "--no-ack", action="store_true", help="send the message once, without acknowledgement"
    )
    parser.add_argument(
        "--wait",
        type=_seconds,
        default=30.0,
        metavar="SECONDS",
        help="time to wait for the delivery; 0: do not wait. The node keeps trying after that time "
        "(default: %(default)g)",
    )
    parsed = parser.parse_args(arguments)
    text = parsed.text
    payload = sys.stdin.buffer.read() if text is None else os.fsencode(text)
    check_size(payload)
    arrived, ticket = _client(parsed).send(
        parsed.to, payload, port=parsed.port, reliable=not parsed.no_ack, wait_s=parsed.wait
    )
    print(ticket)
    return 0 if arrived else 1


@ends_as("mesh_listen")
def listen(arguments: Sequence[str] | None = None) -> int:
    """Print the messages that arrive, one line each, until Ctrl-C."""
    parser = _parser("mesh_listen", "Prints the messages that a node receives.")
    parser.add_argument("--port", type=_port, help="print only messages for this port")
    parser.add_argument(
        "-c", "--count", type=_count, help="number of messages to print (default: until Ctrl-C)"
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object per line, with the payload in base64",
    )
    parsed = parser.parse_args(arguments)
    for number, message in enumerate(_client(parsed).listen(parsed.port), start=1):
        print(_as_json(message) if parsed.json else _as_text(message), flush=True)
        if number == parsed.count:
            return 0
    print("mesh_listen: the node has stopped", file=sys.stderr)
    return 1


@ends_as("mesh_ping")
def ping(arguments: Sequence[str] | None = None) -> int:
    """Send echo requests to a node; the exit status is 1 if none was answered."""
    parser = _parser(
        "mesh_ping", "Sends echo requests to a node and prints round trip, hops and loss."
    )
    _add_echo_arguments(parser)
    parser.add_argument(
        "-c", "--count", type=_count, help="number of requests (default: until Ctrl-C)"
    )
    parser.add_argument(
        "-i",
        "--interval",
        type=_seconds,
        default=1.0,
        metavar="SECONDS",
        help="time between two requests (default: %(default)g)",
    )
    parser.add_argument(
        "-s",
        "--size",
        type=_size,
        metavar="BYTES",
        help="instead, send reliable messages of this size, and time their acknowledgements; "
        f"programs on the node receive them on port {MAX_DATA_PORT}",
    )
    parsed = parser.parse_args(arguments)
    probe = _echo if parsed.size is None else _message_of(parsed.size)
    round_trips_s: list[float] = []
    asked = 0

    @ends_as("mesh_ping")
    def work() -> int:
        nonlocal asked
        node = _client(parsed)
        while parsed.count is None or asked < parsed.count:
            if asked:
                time.sleep(parsed.interval)
            took_s, words = probe(node, parsed.id, parsed.timeout)
            asked += 1
            if took_s is not None:
                round_trips_s.append(took_s)
            print(f"node {parsed.id}: number {asked}{words}", flush=True)
        return 0

    status = work()
    if asked:
        print(_summary(asked, round_trips_s))
        status = 0 if round_trips_s else 1
    return status


@ends_as("mesh_trace")
def trace(arguments: Sequence[str] | None = None) -> int:
    """Print the path to a node; the exit status is 1 if it does not answer."""
    parser = _parser("mesh_trace", "Prints the path of packets to a node.")
    _add_echo_arguments(parser)
    parsed = parser.parse_args(arguments)
    answer = _client(parsed).echo(parsed.id, parsed.timeout)
    if not answer["answered"]:
        print(f"mesh_trace: node {parsed.id} does not answer", file=sys.stderr)
        return 1
    for number, hop in enumerate([*answer["route"], parsed.id], start=1):
        print(f"{number:3}  node {hop}")
    print(f"round trip: {1e3 * answer['round_trip_s']:.1f} ms")
    return 0


# What they share -------------------------------------------------------------------------------


def _parser(command: str, description: str) -> argparse.ArgumentParser:
    """A parser with the options that choose the node of this machine."""
    parser = argparse.ArgumentParser(
        command,
        description=description,
        epilog="Without --node, the command uses the node given in the environment variable "
        f"{NODE_VARIABLE}, or else the only node that runs here.",
    )
    parser.add_argument("--node", type=_node_id, help="id of the node on this machine to use")
    parser.add_argument(
        "--socket",
        type=Path,
        metavar="PATH",
        help="socket of the node (default: the one that --node names)",
    )
    return parser


def _client(parsed: argparse.Namespace) -> LocalClient:
    """The node that the options select. Raises MeshError."""
    return node_here(parsed.node) if parsed.socket is None else LocalClient(parsed.socket)


def _add_echo_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the node to send echo requests to, and the time to wait for its answer."""
    parser.add_argument("id", type=_node_id, help="id of the node that answers")
    parser.add_argument(
        "-W",
        "--timeout",
        type=_seconds,
        default=5.0,
        metavar="SECONDS",
        help="time to wait for an answer (default: %(default)g)",
    )


def _destination(text: str) -> int:
    """A node id, "all" or "gateway", for argparse."""
    if text in _DESTINATIONS:
        return _DESTINATIONS[text]
    try:
        return _node_id(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error}, gateway or all") from None


# mesh_listen -----------------------------------------------------------------------------------


def _as_json(message: dict[str, Any]) -> str:
    return json.dumps({**message, "payload": base64.b64encode(message["payload"]).decode()})


def _as_text(message: dict[str, Any]) -> str:
    payload: bytes = message["payload"]
    try:
        text = payload.decode()
        shown = text if text.isprintable() else repr(text)
    except UnicodeDecodeError:
        shown = payload.hex(" ")
    return f"node {message['sender']} port {message['port']}: {shown}"


# mesh_ping -------------------------------------------------------------------------------------


def _echo(node: LocalClient, to: int, timeout_s: float) -> Probed:
    try:
        answer = node.echo(to, timeout_s)
    except Refused as error:
        return None, f": {error}"
    if not answer["answered"]:
        return None, f": no answer within {timeout_s:g} s"
    took_s = answer["round_trip_s"]
    return took_s, f", {in_hops(answer['hops'])}, {1e3 * took_s:.1f} ms"


def _message_of(size: int) -> Callable[[LocalClient, int, float], Probed]:
    def ask(node: LocalClient, to: int, timeout_s: float) -> Probed:
        begun_s = time.monotonic()
        try:
            arrived, ticket = node.send(to, b"\0" * size, port=MAX_DATA_PORT, wait_s=timeout_s)
        except Refused as error:
            return None, f", {error}"
        took_s = time.monotonic() - begun_s
        if not arrived:
            return None, f", {ticket}"
        return took_s, f", {size} bytes, {1e3 * took_s:.1f} ms"

    return ask


def _summary(asked: int, round_trips_s: list[float]) -> str:
    lost = 100 * (asked - len(round_trips_s)) / asked
    words = f"{asked} sent, {len(round_trips_s)} answered, {lost:.0f} % lost"
    if round_trips_s:
        mean = sum(round_trips_s) / len(round_trips_s)
        figures = "/".join(f"{1e3 * s:.1f}" for s in (min(round_trips_s), mean, max(round_trips_s)))
        words += f"; round trip min/mean/max {figures} ms"
    return words
