#!/usr/bin/env python3
"""python3 -m drone_mesh.lab: experiments without ROS."""

from __future__ import annotations

import sys
from typing import Callable

from drone_mesh.stopping import run_with_extra


def _load() -> Callable[[], int]:
    from drone_mesh.lab.command import main

    return main


def main() -> int:
    """Run the program, or name the extra that it needs; the exit status."""
    return run_with_extra("drone-mesh-lab", "lab", _load)


if __name__ == "__main__":
    sys.exit(main())
