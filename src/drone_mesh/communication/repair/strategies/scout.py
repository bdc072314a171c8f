"""Scout: like Thesis, but later rounds of a group follow sooner after its first flight.

The rule is our own: a step back takes about 5 s, so a third of the patience suffices.
"""

from __future__ import annotations

from drone_mesh.communication.repair.election import TOOK_OFF, TOOK_OFF_HOME
from drone_mesh.communication.repair.strategies.thesis import Thesis
from drone_mesh.drone.location import Location

LATER_ROUNDS = 1.0 / 3.0  # of the patience, our choice: a step back takes about 5 s


class Scout(Thesis):
    """Looks for a gateway in quick succession."""

    _drone_flew = False  # one of the group, since the connection was lost

    def patience(self, silent: bool) -> float:
        """Later rounds come sooner."""
        return LATER_ROUNDS if self._drone_flew and not silent else super().patience(silent)

    def on_gateway_found(self) -> None:
        """Start over: the next loss is a new one."""
        super().on_gateway_found()
        self._drone_flew = False

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """Also note that a drone of the group flies."""
        self._drone_flew = self._drone_flew or score in (TOOK_OFF, TOOK_OFF_HOME)
        super().on_bid(node, score, from_, about)
