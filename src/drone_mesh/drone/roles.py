"""Role: what a drone does in the mesh, and the body that it has."""

from __future__ import annotations

import enum


class Role(enum.IntEnum):
    """What a node is; the values are those of NodeState.msg."""

    ROUTER = 0
    GATEWAY = 1

    @property
    def word(self) -> str:
        """The word that people see."""
        return self.name.lower()

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Edges of the drone's box along x, y and z, in metres (reference, section 11)."""
        return (0.2, 0.1, 0.2) if self is Role.GATEWAY else (0.2, 0.2, 0.1)
