"""The program raspberry_status: a gateway's status as a table."""

from __future__ import annotations

import argparse
import json
import os
import sys
import urllib.error
import urllib.request
from typing import Sequence

from drone_mesh.internet import DEFAULT_PORT
from drone_mesh.raspberry.http_options import TOKEN_VARIABLE
from drone_mesh.raspberry.node_status import table

ANSWER_WITHIN_S = 10.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Print it; the exit status is 1 if the gateway does not answer properly."""
    parser = argparse.ArgumentParser(
        "raspberry_status",
        description="Prints the status of a gateway.",
        epilog=f"Environment: {TOKEN_VARIABLE}, the token of the gateway, if it needs one.",
    )
    parser.add_argument(
        "url",
        nargs="?",
        default=f"http://127.0.0.1:{DEFAULT_PORT}",
        help="address of the gateway (default: %(default)s)",
    )
    url = parser.parse_args(arguments).url.rstrip("/")
    request = urllib.request.Request(f"{url}/status")
    token = os.environ.get(TOKEN_VARIABLE, "")
    if token:
        request.add_header("Authorization", f"Bearer {token}")
    try:
        with urllib.request.urlopen(request, timeout=ANSWER_WITHIN_S) as answer:
            print(table(json.load(answer)))
    except urllib.error.HTTPError as error:
        print(f"raspberry_status: {url}: {_reason(error)}", file=sys.stderr)
        return 1
    except (AttributeError, KeyError, TypeError):
        print(f"raspberry_status: {url}: this is no node of the mesh", file=sys.stderr)
        return 1
    except urllib.error.URLError as error:  # its text wraps the reason in "<urlopen error ...>"
        print(f"raspberry_status: {url}: {error.reason}", file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f"raspberry_status: {url}: {error}", file=sys.stderr)
        return 1
    return 0


def _reason(error: urllib.error.HTTPError) -> str:
    try:
        with error:
            return str(json.load(error)["detail"])
    except (ValueError, KeyError, TypeError):
        return str(error)
