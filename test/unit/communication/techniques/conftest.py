"""The techniques are tested with the rigs of the mesh software."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
