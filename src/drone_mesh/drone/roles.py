"""Role: the function of a drone in the mesh, and its size."""

from __future__ import annotations

import enum


class Role(enum.IntEnum):
    """The role of a node; the values are those of NodeState.msg."""

    ROUTER = 0
    GATEWAY = 1

    @property
    def word(self) -> str:
        """The role in lower case, for display."""
        return self.name.lower()

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Edges of its box along x, y, z, in metres (docs/ros.md, "World and flights")."""
        return (0.2, 0.1, 0.2) if self is Role.GATEWAY else (0.2, 0.2, 0.1)
