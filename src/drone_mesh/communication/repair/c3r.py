"""C3R: the neighbours of a dead node take turns at its place, and return to their own.

docs/strategies.md, "Turns".
"""

from __future__ import annotations

import math

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import TOOK_OFF
from drone_mesh.communication.repair.group_repair import LATER_ROUNDS
from drone_mesh.communication.repair.interfaces import Step
from drone_mesh.communication.repair.nearest import Nearest
from drone_mesh.drone.location import Location

TURN_S = 60.0  # at the place of the dead node; the paper leaves it to the battery
TURNS = 2  # of one drone; then it stays, so that the coming and going ends


class C3R(Nearest):
    """The drones that a dead node cut off hold its place in turn; each returns to its own.

    After C3R: Tamboli, Younis, "Coverage-aware connectivity restoration in mobile sensor networks",
    JNCA 33(4), 2010. No layout changes for good; the price is that the group is cut off at each
    change of turns, and the distance. Whoever had the fewest turns is next, of these the nearest;
    an election decides, as a node does not know the others beside the dead one. A drone that holds
    the place is connected: it takes leave of the mesh before it flies. It stays if nobody depends
    on it, who could take its turn.
    """

    _own_place: Location | None = None  # during a turn: where it stood before
    _since_s = math.inf  # this turn, connected
    _turns = 0
    _flown_s = -math.inf  # when a neighbour last flew to the place, or from it

    def patience(self, silent: bool) -> float:
        """The next turn follows soon."""
        patience = super().patience(silent)
        is_next = patience == 1.0 and self.mesh.now_s - self._flown_s < 2.0 * TURN_S
        return LATER_ROUNDS if is_next else patience

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """A neighbour bids, or takes off: for its turn, or after it."""
        if score == TOOK_OFF:
            self._flown_s = self.mesh.now_s
        super().on_bid(node, score, from_, about)

    def on_connected_check(self) -> None:
        """Return when the turn is over, if another drone may take the next one."""
        mesh, own_place = self.mesh, self._own_place
        if own_place is None:
            return
        self._since_s = min(self._since_s, mesh.now_s)
        is_over = mesh.now_s - self._since_s >= TURN_S and self._turns < TURNS
        needed = any(not mesh.has_own_way(node) for node in mesh.neighbours())
        if is_over and needed and not mesh.why_not_fly():
            self._turns += 1
            mesh.bid(TOOK_OFF, about=own_place)
            mesh.leave()
            mesh.fly(Step(own_place, mesh.node_id))

    def on_stopped(self) -> None:
        """It flies, for whatever reason: no turn goes on."""
        super().on_stopped()
        self._own_place, self._since_s = None, math.inf

    def _score(self, step: Step) -> float:
        score = super()._score(step)
        return score / (1 + self._turns) if score > 0 else score

    def _occupant(self, step: Step) -> int:
        """A drone that held the place before, and has left, does not occupy it."""
        occupant = super()._occupant(step)
        view = self.mesh.reachable().get(occupant) if occupant == step.owner else None
        place = None if view is None else view.place
        has_left = place is not None and place.distance_m(step.place) >= self.mesh.clearance_m
        return NO_ROUTE if has_left else occupant

    def _fly(self, step: Step) -> None:
        own_place = self.mesh.own_place()
        super()._fly(step)
        self._own_place = None if step.home else own_place
