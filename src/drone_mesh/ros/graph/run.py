"""The run of a simulation: tells what belongs to this world from what an earlier one left behind.

Each world has a new run. Topics whose messages mean nothing in another world carry it in the header
of their connections, since the definitions of their messages are fixed.
"""

from __future__ import annotations

import secrets
from typing import Any

FIELD = "run"  # of the connection header

Run = str
"""The name of a run; empty: the world is of another program, which has none."""


def new_run() -> Run:
    """The name of a new run, different from all earlier ones."""
    return secrets.token_hex(8)


def run_headers(run: Run) -> dict[str, str]:
    """The connection headers of a publisher in this run."""
    return {FIELD: run} if run else {}


def run_of(message: Any) -> Run:
    """The run in which a received message was published; empty if its publisher named none."""
    return str(message._connection_header.get(FIELD, ""))


def is_left_behind(message: Any, run: Run) -> bool:
    """Whether a received message names another run. Publishers of other programs name none."""
    return run_of(message) not in ("", run)
