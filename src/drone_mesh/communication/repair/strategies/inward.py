"""Inward: all neighbours of the lost next hop move towards its place, by half the range at most.

After RIM: Younis, Lee, Abbasi, "A Localized Algorithm for Restoring Internode Connectivity in
Networks of Moveable Sensors", IEEE TC 59(12), 2010. Only the parts without a gateway move, so one
move may not suffice: a second one leads to the place itself, and a third flight to the gateway.
"""

from __future__ import annotations

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.repair.actions import Step
from drone_mesh.communication.repair.spots import WITHIN_REACH
from drone_mesh.communication.repair.strategies.home import Home
from drone_mesh.drone.location import Location

MOVES = 2  # towards one lost next hop
WAITS = 6  # checks; the drones beside the dead node have moved twice by then


class Inward(Home):
    """No election: each neighbour of the dead node moves, and others follow their neighbours."""

    _lost: Step | None = None  # the place of the lost next hop
    _moves = 0
    _waits = 0  # for the drones beside the dead node, in checks

    def on_gateway_found(self) -> None:
        """Start over: the next loss is a new one."""
        self._lost, self._moves, self._waits = None, 0, 0

    def on_emergency(self) -> None:
        """Move inward; if that has not helped, fly home."""
        mesh, here = self.mesh, self.mesh.own_place()
        if self._lost is None and mesh.reaches(mesh.lost_next_hop) and self._waits < WAITS:
            self._waits += 1
            self.reason = f"{mesh.lost_next_hop} is nearer to the lost node"
            return
        if self._lost is None and mesh.steps and not mesh.steps[0].home:
            self._lost = mesh.steps[0]
        if self._lost is None or self._moves >= MOVES or here is None or mesh.why_not_fly():
            super().on_emergency()
            return
        self._moves += 1
        away_m = here.distance_m(self._lost.place)
        half_m = mesh.range_m / 2
        if away_m > half_m or self._moves == MOVES:
            stop_m = half_m if self._moves < MOVES else max(0.0, away_m - half_m)
            self._move_to(Step(self._lost.place.towards(here, stop_m), self._lost.owner))

    def on_place(self, node: int, place: Location) -> None:
        """If a neighbour moves out of reach, follow it as far as needed."""
        mesh, here = self.mesh, self.mesh.own_place()
        may_move = not (mesh.connected or mesh.state is RepairState.FLYING or mesh.why_not_fly())
        if here is None or not may_move or node not in mesh.neighbours() or self._moves_itself():
            return
        if here.distance_m(place) > mesh.range_m:
            self._move_to(Step(place.towards(here, WITHIN_REACH * mesh.range_m), node))

    def _moves_itself(self) -> bool:
        """Whether it is beside the dead node and may still move."""
        is_beside = self._lost is not None or not self.mesh.reaches(self.mesh.lost_next_hop)
        return is_beside and self._moves < MOVES

    def _move_to(self, step: Step) -> None:
        self.mesh.announce_place(self.mesh.goal_of(step))
        self.mesh.fly(step)
