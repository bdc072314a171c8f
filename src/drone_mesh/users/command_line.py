"""Shared by the commands mesh_send, mesh_listen, mesh_ping and mesh_trace."""

from __future__ import annotations

import argparse
from pathlib import Path

from drone_mesh.arguments import MOST, decimal, whole
from drone_mesh.communication.data.packets import MAX_DATA_PORT, MAX_MESSAGE_BYTES
from drone_mesh.communication.data.ticket import TO_ALL, TO_GATEWAY
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.users.local_client import NODE_VARIABLE, LocalClient, node_here

MOST_SECONDS = 86400.0  # our choice: a day

node_id = whole(0, MAX_NODE_ID)
port = whole(0, MAX_DATA_PORT)
count = whole(1, MOST)
size = whole(1, MAX_MESSAGE_BYTES)
seconds = decimal(0.0, MOST_SECONDS)

_DESTINATIONS = {"all": TO_ALL, "gateway": TO_GATEWAY}


def parser_for(command: str, description: str) -> argparse.ArgumentParser:
    """A parser with the options that choose the node of this machine."""
    parser = argparse.ArgumentParser(
        command,
        description=description,
        epilog="Without --node, the command uses the node given in the environment variable "
        f"{NODE_VARIABLE}, or else the only node that runs here.",
    )
    parser.add_argument("--node", type=node_id, help="id of the node on this machine to use")
    parser.add_argument(
        "--socket",
        type=Path,
        metavar="PATH",
        help="socket of the node (default: the one that --node names)",
    )
    return parser


def add_echo_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the node to send echo requests to, and the time to wait for its answer."""
    parser.add_argument("id", type=node_id, help="id of the node that answers")
    parser.add_argument(
        "-W",
        "--timeout",
        type=seconds,
        default=5.0,
        metavar="SECONDS",
        help="time to wait for an answer (default: %(default)g)",
    )


def destination(text: str) -> int:
    """A node id, "all" or "gateway", for argparse."""
    if text in _DESTINATIONS:
        return _DESTINATIONS[text]
    try:
        return node_id(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error}, gateway or all") from None


def client(parsed: argparse.Namespace) -> LocalClient:
    """The node that the options select. Raises MeshError."""
    return node_here(parsed.node) if parsed.socket is None else LocalClient(parsed.socket)
