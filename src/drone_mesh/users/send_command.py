"""The program mesh_send."""

from __future__ import annotations

import os
import sys
from typing import Sequence

from drone_mesh.communication.data.packets import MAX_DATA_PORT, MAX_MESSAGE_BYTES, check_size
from drone_mesh.stopping import ends_as
from drone_mesh.users import command_line


@ends_as("mesh_send")
def main(arguments: Sequence[str] | None = None) -> int:
    """Send one message; the exit status is 1 if it was not delivered."""
    parser = command_line.parser_for(
        "mesh_send", f"Sends a message of up to {MAX_MESSAGE_BYTES} bytes through the mesh."
    )
    parser.add_argument(
        "to", type=command_line.destination, metavar="TO", help='node id, "gateway" or "all"'
    )
    parser.add_argument(
        "text", nargs="?", help="the message (default: the bytes on standard input)"
    )
    parser.add_argument(
        "--port",
        type=command_line.port,
        default=0,
        help=f"port of the receiver, 0..{MAX_DATA_PORT} (default: %(default)s)",
    )
    parser.add_argument(
        "--no-ack", action="store_true", help="send the message once, without acknowledgement"
    )
    parser.add_argument(
        "--wait",
        type=command_line.seconds,
        default=30.0,
        metavar="SECONDS",
        help="time to wait for the delivery; 0: do not wait. The node keeps trying after that time "
        "(default: %(default)g)",
    )
    parsed = parser.parse_args(arguments)
    text = parsed.text
    payload = sys.stdin.buffer.read() if text is None else os.fsencode(text)
    check_size(payload)
    arrived, ticket = command_line.client(parsed).send(
        parsed.to, payload, port=parsed.port, reliable=not parsed.no_ack, wait_s=parsed.wait
    )
    print(ticket)
    return 0 if arrived else 1
