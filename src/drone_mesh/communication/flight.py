"""Watching a flight, as seen from the mesh (reference, section 9, "Flight")."""

from __future__ import annotations

from drone_mesh.communication.timing import LANDED_WITHIN_M
from drone_mesh.drone.interfaces import Location

STANDS_STILL_WITHIN_M = 1e-3  # our choice: far below what a drone flies in a second
ASKS_WITHOUT_ANSWER = 10  # our choice: then nobody will ever know; the mesh has to go on


class Flight:
    """One flight: where to, and whether it is over."""

    def __init__(self, goal: Location) -> None:
        self.goal = goal
        self._last: Location | None = None
        self._unanswered = 0

    def is_over(self, location: Location | None) -> bool:
        """Take note of where the drone is (None: it cannot say); whether it has landed.

        Landed is within 0.1 m of the goal, or no longer moving between two questions.
        """
        if location is None:
            self._unanswered += 1
            return self._unanswered >= ASKS_WITHOUT_ANSWER
        self._unanswered = 0
        if location.distance_m(self.goal) <= LANDED_WITHIN_M:
            return True
        still = self._last is not None and location.distance_m(self._last) < STANDS_STILL_WITHIN_M
        self._last = location
        return still
