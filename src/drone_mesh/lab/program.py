"""The command that started the lab, as hints name it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

_BY_FILE = {"drone-mesh-lab": "drone-mesh-lab", "lab": "rosrun drone_mesh lab"}


def _program() -> str:
    if "DRONE_MESH_LAB" in os.environ:  # by scripts/lab, which needs no installed package
        return os.environ["DRONE_MESH_LAB"]
    return _BY_FILE.get(Path(sys.argv[0]).name, "python3 -m drone_mesh.lab")


PROGRAM = _program()
