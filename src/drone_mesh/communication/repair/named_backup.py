"""NamedBackup: a cut vertex names the neighbour that takes its place, before it dies.

docs/strategies.md, "A backup that is named beforehand".
"""

from __future__ import annotations

import math
from typing import Mapping

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import BACKUP, TOOK_OFF, TOOK_OFF_HOME
from drone_mesh.communication.repair.interfaces import RepairActions, Step
from drone_mesh.communication.repair.lone_repair import SAMPLES
from drone_mesh.communication.repair.nearest import Nearest
from drone_mesh.communication.repair.spots import WITHIN_REACH, may_be_flown_to
from drone_mesh.drone.location import Location

NAMED_FOR = 2.5  # check periods: a name that is not repeated ends
ANSWERS_S = 0.5  # others answer within milliseconds, and pass on a way that is left
ALONE_S = 10.0  # where the usual wait is longer, a failure of the medium would send it in vain
FEW_SAMPLES = 6  # of the power in the channel, before an early look: less than a second
LATER = 2.0  # patience after a look in vain: the next one comes no earlier than without a backup


def backup_for(mesh: RepairActions, present: int) -> int:
    """The neighbour that should take the place of this node; NO_ROUTE: it is no cut vertex.

    Whether two neighbours hear each other is what their beacons show, or, without such news, what
    their places say. Those parts of them that are left without a way to the gateway need a backup.
    """
    views = mesh.neighbours()
    here = mesh.own_place()
    heard = {node: {node} | mesh.heard_by(node) - {mesh.node_id} for node in views}
    for node, view in views.items():
        for other, others_view in views.items():
            one, two = view.place, others_view.place
            if one and two and one.distance_m(two) < WITHIN_REACH * mesh.range_m:
                heard[node].add(other)
    ranks = []
    for part in _parts(heard):
        if mesh.lost_next_hop in part or any(map(mesh.has_own_way, part)):
            continue
        for node in part & views.keys():
            place = views[node].place
            if here is None or place is None:
                continue
            behind = heard[node] - views.keys()
            behind.difference_update(*(heard[n] for n in views if n != node))
            degree, away_m = len(heard[node]) - 1, here.distance_m(place)
            # A lone one could not tell the death of this node from a failure of the medium.
            rank = bool(behind), not degree, node != present, degree, away_m, node
            ranks.append(rank)
    return min(ranks)[-1] if ranks else NO_ROUTE


def _parts(heard: Mapping[int, set[int]]) -> list[set[int]]:
    """The connected parts of a graph of nodes and those that each hears."""
    parts: list[set[int]] = []
    for group in heard.values():
        joined = set(group)
        apart = []
        for part in parts:
            if part & joined:
                joined |= part
            else:
                apart.append(part)
        parts = [*apart, joined]
    return parts


class NamedBackup(Nearest):
    """A backup, named beforehand, takes the place of a cut vertex at once, without an election.

    After PADRA: Akkaya, Senel, Thimmapuram, Uludag, "Distributed Recovery from Network
    Partitioning in Movable Sensor/Actor Networks via Controlled Mobility", IEEE TC 59(2), 2010, and
    DCR: Imran, Younis, Md Said, Hasbullah, "Localized motion-based connectivity restoration
    algorithms for wireless sensor and actor networks", JNCA 35(2), 2012. Each node finds by the
    news of two hops whether it is a cut vertex; its backup is a neighbour that is none, of these
    the one with the least degree, then the nearest. Only the parts without a gateway act. A backup
    that is a cut vertex itself has named its own, which follows it. Where no name came, or a flight
    did not help, the group elects as with `nearest`.
    """

    _backup = NO_ROUTE  # of this node
    _step: Step | None = None  # to the place of the node that named this one, while it asks
    _was_early = False  # alone, it has looked around before the usual time

    def start(self, mesh: RepairActions) -> None:
        """Called once, before any other call."""
        super().start(mesh)
        self._named: dict[int, tuple[Location, float]] = {}  # by whom: its place, and when
        self._answered: set[int] = set()

    def on_connected_check(self) -> None:
        """Name the backup of this drone, if it needs one."""
        mesh = self.mesh
        self._backup, here = backup_for(mesh, self._backup), mesh.own_place()
        if self._backup != NO_ROUTE and here is not None:
            mesh.bid(BACKUP, about=here, only_to=self._backup)

    def patience(self, silent: bool) -> float:
        """After an early look around the next one waits as long as if that had been a usual one."""
        patience = super().patience(silent)
        return max(LATER, patience) if self._was_early else patience

    def on_gateway_lost(self) -> None:
        """If it is the backup of the node that has fallen silent, ask who else is there."""
        mesh = self.mesh
        silent = [n for n in self._named if n not in mesh.neighbours()]
        steps = [self._step_to(n) for n in (mesh.lost_next_hop, *silent) if self._stood(n)]
        is_usual = mesh.in_motion or mesh.silent or mesh.why_not_fly()
        self._step = None if is_usual else next(filter(None, steps), None)
        if self._step is None:
            return
        self._answered.clear()
        mesh.ask_places()
        if mesh.neighbours().keys() - {self._step.owner}:
            mesh.wait_until(mesh.now_s + mesh.medium.stretched(ANSWERS_S))
        elif mesh.connection_lost_after_s <= ALONE_S:  # as one alone, if its channel is not jammed
            self._dead, self._step, self._was_early = self._step.owner, None, True
            self.samples_wanted = FEW_SAMPLES
            self.on_emergency_alone()

    def on_emergency(self) -> None:
        """The usual course."""
        self._step, self._was_early, self.samples_wanted = None, False, SAMPLES
        super().on_emergency()

    def on_gateway_found(self) -> None:
        """Nothing is to be taken."""
        super().on_gateway_found()
        self._step, self._was_early, self._dead = None, False, NO_ROUTE

    def on_stopped(self) -> None:
        """It flies by order, or its antenna is off."""
        super().on_stopped()
        self._step, self._dead = None, NO_ROUTE

    def on_neighbour_found(self, node: int) -> None:
        """If it flies, alone, to the place of `node`, that one lives: it turns back."""
        super().on_neighbour_found(node)
        if node == self._dead and self.mesh.state is RepairState.FLYING:
            self._back()

    def _look(self, step: Step, here: Location) -> None:
        dead = self._dead
        super()._look(step, here)
        self._dead = dead

    def on_place(self, node: int, place: Location) -> None:
        """Whoever answers is alive."""
        self._answered.add(node)
        if node == self._dead:
            self._dead = NO_ROUTE
        super().on_place(node, place)

    def on_time(self) -> None:
        """Fly, if the node that named this one did not answer and others did."""
        mesh, step = self.mesh, self._step
        if step is None or mesh.state is not RepairState.LOST:
            super().on_time()
            return
        self._step = None
        if self._answered and step.owner not in self._answered and not mesh.connected:
            self._take(step)

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """A neighbour names this one its backup, bids, or takes off."""
        mesh = self.mesh
        if score == BACKUP:
            if node == from_ and node in mesh.neighbours() and about is not None:
                self._named[node] = about, mesh.now_s
            return
        super().on_bid(node, score, from_, about)
        leaves = score in (TOOK_OFF, TOOK_OFF_HOME) and node == from_
        is_free = not mesh.connected and mesh.state in (RepairState.LOST, RepairState.AT_REST)
        if leaves and is_free and about is not None and not self._in_reach_of(about, node):
            step = self._step_to(node)
            if step is not None:
                self._take(step)

    def _stood(self, node: int) -> bool:
        """Whether a node that named this one was there until the end: else it has flown away."""
        place, seen = self._named.get(node, (None,))[0], self.mesh.view(node).place
        return place is not None and (
            seen is None or seen.distance_m(place) < self.mesh.clearance_m
        )

    def _step_to(self, node: int) -> Step | None:
        """To the place of a node that has named this one lately, and is or was in reach."""
        place, named_s = self._named.get(node, (None, -math.inf))
        mesh, here = self.mesh, self.mesh.own_place()
        if place is None or mesh.now_s - named_s > NAMED_FOR * mesh.check_period_s:
            return None
        known = [step for step in mesh.steps if step.owner == node]  # as late as can be
        known += [Step(inside, node) for inside in mesh.within_fence(place)]
        if not known:
            return None
        step = known[0]
        near = here is not None and here.distance_m(step.place) <= mesh.range_m / WITHIN_REACH
        return step if near and may_be_flown_to(step.place) and not mesh.was_at(step) else None

    def _in_reach_of(self, goal: Location, node: int) -> bool:
        """Whether this drone, or a neighbour beside `node`, will hear who lands at `goal`."""
        mesh = self.mesh
        views = [view.place for n, view in mesh.neighbours().items() if n != node]
        places = [place for place in (mesh.own_place(), *views) if place is not None]
        return any(place.distance_m(goal) < WITHIN_REACH * mesh.range_m for place in places)

    def _take(self, step: Step) -> None:
        """Tell the group, whose own backups follow, and fly."""
        mesh = self.mesh
        if not mesh.why_not_fly():
            mesh.bid(TOOK_OFF, about=mesh.goal_of(step))
            self._fly(step)
