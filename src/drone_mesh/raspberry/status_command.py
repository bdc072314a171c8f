"""The program raspberry_status: a gateway's status as a table."""

from __future__ import annotations

import argparse
import os
from typing import Sequence

from drone_mesh.internet import DEFAULT_PORT
from drone_mesh.raspberry.connection_options import TOKEN_VARIABLE
from drone_mesh.raspberry.node_reports import table
from drone_mesh.stopping import ends_as
from drone_mesh.web import LOOPBACK
from drone_mesh.web.json_client import NoAnswer, ask_json

ANSWER_WITHIN_S = 10.0


@ends_as("raspberry_status")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print it; the exit status is 1 if the gateway does not answer properly."""
    parser = argparse.ArgumentParser(
        "raspberry_status",
        description="Prints the status of a gateway, or of a router with --http, as a table.",
        epilog=f"Environment: {TOKEN_VARIABLE}, the token of that node, if it needs one.",
    )
    parser.add_argument(
        "url",
        nargs="?",
        default=f"http://{LOOPBACK}:{DEFAULT_PORT}",
        help="address of the node (default: %(default)s)",
    )
    url = parser.parse_args(arguments).url.rstrip("/")
    if not url.startswith(("http://", "https://")):
        parser.error(f"{url}: must begin with http:// or https://")
    token = os.environ.get(TOKEN_VARIABLE, "")
    try:
        print(table(ask_json(f"{url}/status", ANSWER_WITHIN_S, token)))
    except (AttributeError, KeyError, TypeError) as error:
        raise NoAnswer(f"{url}: the answer is not from a mesh node; check the address") from error
    return 0
