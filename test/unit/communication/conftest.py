"""The tests in the rooms use the rigs of the mesh software."""

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "routing")]


@pytest.fixture
def rig():
    """Router 1, which nobody has heard yet."""
    from rig import Rig

    return Rig()
