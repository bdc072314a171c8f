"""The default range of a simulated radio."""

from __future__ import annotations

from drone_mesh.communication.repair.options import RANGE_M

MAX_DISTANCE_M = RANGE_M
