"""The program drone_mesh_console, or one line if a package that it needs is missing."""

from __future__ import annotations

import sys
from typing import Callable

from drone_mesh.stopping import run_with_extra


def _load() -> Callable[[], int]:
    from drone_mesh.console.gateway_command import main

    return main


def main() -> int:
    """Run the program; the exit status."""
    return run_with_extra("drone_mesh_console", "console", _load)


if __name__ == "__main__":
    sys.exit(main())
