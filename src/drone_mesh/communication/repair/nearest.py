"""Nearest: the drone of a group with the shortest flight takes the place of its lost next hop."""

from __future__ import annotations

from drone_mesh.communication.repair.election import NO_BID
from drone_mesh.communication.repair.group_repair import GroupRepair
from drone_mesh.communication.repair.interfaces import Step


class Nearest(GroupRepair):
    """The drone of a group that is nearest to the place of its lost next hop takes it.

    After DARA: Abbasi, Younis, Akkaya, "Movement-Assisted Connectivity Restoration in Wireless
    Sensor and Actor Networks", IEEE TPDS 20(9), 2009; only the parts without a gateway act. The
    children that the drone leaves behind lose their gateway, and repeat the same: the cascade of
    DARA.
    """

    def _score(self, step: Step) -> float:
        """Above 1 for a first choice, otherwise up to 1; the shorter the flight, the higher."""
        here = self.mesh.own_place()
        if here is None:
            self.reason = "does not know where it is"
            return NO_BID
        score = 1.0 / (1.0 + here.distance_m(step.place))
        return score if self._is_second_choice(step) else 1.0 + score
