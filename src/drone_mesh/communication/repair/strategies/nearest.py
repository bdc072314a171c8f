"""Nearest: the drone of a group that is nearest to the place of its lost next hop takes it.

After DARA: Abbasi, Younis, Akkaya, "Movement-Assisted Connectivity Restoration in Wireless Sensor
and Actor Networks", IEEE TPDS 20(9), 2009; only the parts without a gateway act. The children that
the drone leaves behind lose their gateway, and repeat the same: the cascade of DARA.
"""

from __future__ import annotations

from drone_mesh.communication.repair.actions import Step
from drone_mesh.communication.repair.election import NO_BID
from drone_mesh.communication.repair.group_repair import GroupRepair


class Nearest(GroupRepair):
    """The drone with the shortest flight wins."""

    def _score(self, step: Step) -> float:
        """Above 1 for a first choice, otherwise up to 1; the shorter the flight, the higher."""
        own = self.mesh.own_place()
        if own is None:
            self.reason = "does not know where it is"
            return NO_BID
        score = 1.0 / (1.0 + own.distance_m(step.place))
        return score if self._is_second_choice(step) else 1.0 + score
