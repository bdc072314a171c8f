"""RepairStatus: a node's reaction to a lost connection, and its reason.

Every view displays the sentence written here, so all use the same words.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import LOOKS, NO_BID
from drone_mesh.drone.location import Location


class RepairStatus(NamedTuple):
    """The repair of one node at one moment. Immutable, so any thread may read it."""

    state: RepairState = RepairState.AT_REST
    reason: str = ""  # why it does not fly, or why it lands early; empty: it flies, or may do so
    bid: float = NO_BID  # as in MOVEMENT_NEGOTIATION; negative: it does not bid
    bid_unit: str = ""  # of bids above 1
    place_of: int = NO_ROUTE  # the node whose place it bids for or flies to
    goal: Location | None = None  # the goal of its flight
    winner: int = NO_ROUTE  # the node whose take-off it waits for
    emergency_s: float = math.inf  # when its patience ends, in seconds of the core's clock
    silent: bool = False  # all its neighbours, two or more, fell silent together
    landed: bool = False  # the flight ends: it checks whether another drone is there
    jammed: bool = False  # it hears nobody, and measures power in its channel
    ends: str = ""  # what its last flight is, and why: its mesh is lost
    unchecked: bool = False  # it has no gateway, and no check of its own has found that yet

    def in_words(self, now_s: float) -> str:
        """One short sentence about the node; empty if nothing is to be repaired."""
        if self.state is RepairState.LOST:
            return "; ".join(filter(None, (self._waits(now_s), self._does_not_fly())))
        if self.state is RepairState.ASKING:
            return "asks where its neighbours are"
        if self.state is RepairState.NEGOTIATING:
            return f"negotiating, {self._bids()}"
        if self.state is RepairState.WATCHING:
            return f"waits for {self.winner} to take off"
        if self.state is RepairState.FLYING:
            return self._flies()
        if self.unchecked:
            return "has no gateway; its periodic check begins the wait for one"
        return self._does_not_fly()

    def _waits(self, now_s: float) -> str:
        left_s = self.emergency_s - now_s
        time = f" {math.ceil(left_s)} s" if 0 < left_s < math.inf else ""
        why = ": all its neighbours fell silent together" if self.silent else ""
        return f"waits{time} for a gateway{why}"

    def _bids(self) -> str:
        if self.bid < 0:
            return f"does not bid: {self.reason}" if self.reason else "does not bid"
        if self.bid == LOOKS and self.place_of == NO_ROUTE:
            return f"bids {LOOKS:g} to look where another drone did"
        is_quantity = self.bid > 1 and self.bid_unit
        score = f"{self.bid:.1f} {self.bid_unit}" if is_quantity else f"{self.bid:.3g}"
        return f"bids {score} for {self._place()}"

    def _flies(self) -> str:
        if self.landed:
            return "has landed, checks that no other drone is there"
        if self.reason:
            return f"lands: {self.reason}"
        return self.ends or f"flies to {self._place()}"

    def _place(self) -> str:
        if self.place_of == NO_ROUTE:
            return "where it was connected last" if self.goal is None else self.goal.in_words()
        return f"the place of {self.place_of}"

    def _does_not_fly(self) -> str:
        return f"does not fly: {self.reason}" if self.reason else ""


NOTHING_TO_REPAIR = RepairStatus()
NO_CHECK_YET = RepairStatus(unchecked=True)
