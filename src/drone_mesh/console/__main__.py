"""The program drone_mesh_console, or one line if a package that it needs is missing."""

from __future__ import annotations

import sys

from drone_mesh.stopping import Main, run_with_extra


def _load() -> Main:
    from drone_mesh.console.gateway_command import main

    return main


def main() -> int:
    """Run the program; the exit status."""
    return run_with_extra("drone_mesh_console", "console", _load)


if __name__ == "__main__":
    sys.exit(main())
