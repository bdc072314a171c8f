"""The program raspberry_router."""

from __future__ import annotations

from drone_mesh.raspberry.options import parse_router
from drone_mesh.raspberry.program import run


def main() -> int:
    """Run until Ctrl-C or SIGTERM; the exit status."""
    return run("raspberry_router", parse_router)
