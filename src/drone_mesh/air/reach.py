"""How far a simulated radio reaches unless a parameter says otherwise."""

from __future__ import annotations

MAX_DISTANCE_M = 9.0  # docs/protocol.md, "Wireless signal simulator": in range is nearer
