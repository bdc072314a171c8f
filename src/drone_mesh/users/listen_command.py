"""The program mesh_listen."""

from __future__ import annotations

import base64
import json
import sys
from typing import Any, Sequence

from drone_mesh.stopping import ends_as
from drone_mesh.users import command_line


@ends_as("mesh_listen")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the messages that arrive, one line each, until Ctrl-C."""
    parser = command_line.parser_for("mesh_listen", "Prints the messages that a node receives.")
    parser.add_argument("--port", type=command_line.port, help="print only messages for this port")
    parser.add_argument(
        "-c",
        "--count",
        type=command_line.count,
        help="number of messages to print (default: until Ctrl-C)",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object per line, with the payload in base64",
    )
    parsed = parser.parse_args(arguments)
    messages = command_line.client(parsed).listen(parsed.port)
    for number, message in enumerate(messages, start=1):
        print(_as_json(message) if parsed.json else _as_text(message), flush=True)
        if number == parsed.count:
            return 0
    print("mesh_listen: the node has stopped", file=sys.stderr)
    return 1


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
