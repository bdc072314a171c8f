"""The program raspberry_gateway."""

from __future__ import annotations

from drone_mesh.raspberry.options import parse_gateway
from drone_mesh.raspberry.program import run
from drone_mesh.stopping import ends_as


@ends_as("raspberry_gateway")
def main() -> int:
    """Run until Ctrl-C or SIGTERM; the exit status."""
    return run(parse_gateway)
