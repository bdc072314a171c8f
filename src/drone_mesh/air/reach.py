"""How far a simulated radio reaches unless a parameter says otherwise."""

from __future__ import annotations

from drone_mesh.communication.repair_options import RANGE_M

MAX_DISTANCE_M = RANGE_M
