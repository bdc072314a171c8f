"""Stay: no drone ever flies. The baseline for the other strategies."""

from __future__ import annotations

from drone_mesh.communication.repair.interfaces import IRepairStrategy


class Stay(IRepairStrategy):
    """Waits until the routing finds a gateway again."""

    def on_emergency(self) -> None:
        """Nothing."""
        self.reason = "its strategy never flies"
