"""Role: what a drone does in the mesh."""

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
