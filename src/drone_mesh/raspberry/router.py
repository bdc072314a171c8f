"""The program raspberry_router."""

from __future__ import annotations

import sys

from drone_mesh.raspberry.drone_check import check_drone
from drone_mesh.raspberry.options import CHECK_DRONE, parse_router
from drone_mesh.raspberry.program import run
from drone_mesh.stopping import ends_as


@ends_as("raspberry_router")
def main() -> int:
    """Run until Ctrl-C or SIGTERM, or check the drone; the exit status."""
    if sys.argv[-1] != CHECK_DRONE:
        return run(parse_router)
    return check_drone(parse_router(sys.argv[1:-1]))
