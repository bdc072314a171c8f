"""The tests in the rooms use the rigs of the mesh software."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "routing")]
