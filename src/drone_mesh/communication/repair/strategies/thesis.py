"""Thesis: the group elects the drone that is farthest from the gateway, and it flies one step back.

The rule of the Software Design Document of 2019, corrected; docs/repair.md, "Negotiation".
"""

from __future__ import annotations

from drone_mesh.communication.repair.actions import Step
from drone_mesh.communication.repair.election import MAX_SCORE_M, NO_BID
from drone_mesh.communication.repair.group_repair import GroupRepair


class Thesis(GroupRepair):
    """The farthest drone flies; for the second choice, the gateway's place, the nearest."""

    bid_unit = "m"

    def _score(self, step: Step) -> float:
        """Distance to the gateway's place in metres, or NO_BID (docs/repair.md, "Negotiation").

        Without one, as while its mesh passes from one gateway to another: to where it would fly.
        For the second choice the nearest drone flies, unless another one has a first choice.
        """
        own = self.mesh.own_place()
        if own is None:
            self.reason = "does not know where it is"
            return NO_BID
        distance_m = min(own.distance_m(self.mesh.gateway_place or step.place), MAX_SCORE_M)
        return 1.0 / (1.0 + distance_m) if self._is_second_choice(step) else distance_m
