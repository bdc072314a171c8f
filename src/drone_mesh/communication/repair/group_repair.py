"""GroupRepair: the drones of a group elect one that flies one step back.

docs/repair.md, "Negotiation". The score, defined by each derived strategy, decides which one.
"""

from __future__ import annotations

import abc
import math

from drone_mesh.communication.control.router_states import RepairState, RouterEvent
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import (
    HOME_FAILED,
    LOOKS,
    NO_BID,
    TOOK_OFF,
    TOOK_OFF_HOME,
    BidCredit,
    Election,
    FlightNews,
    as_on_the_air,
    highest_plausible,
)
from drone_mesh.communication.repair.interfaces import RepairActions, Step
from drone_mesh.communication.repair.lone_repair import LoneRepair
from drone_mesh.communication.repair.spots import NEAR, PITCH, may_be_flown_to
from drone_mesh.drone.location import Location

PLACES_WITHIN_S = 1.0  # docs/repair.md, "Negotiation": how long to wait for places
SETTLE_S = 0.5  # a bid takes some milliseconds per hop; enough for 50 hops
TAKE_OFF_WITHIN_S = 5.0  # docs/repair.md, "Negotiation": then the winner is passed over
ROUNDS_WITHOUT_FLIER = 2  # docs/repair.md, "Negotiation": then the second choice counts
LATER_ROUNDS = 1.0 / 3.0  # of the patience: a step back takes about 5 s
HOME_FAILED_ROUNDS = 20  # then a drone tries again; another radio may hear the gateway
LOOKS_AFTER = 5  # rounds without a flight; as rarely as a drone that is alone
OCCUPIED_FOR_S = 300.0  # after the last report: the route to who stood there may be a memory, too
HOME_AGAIN_S = 60.0  # docs/repair.md, "Negotiation": between flights of a group to a gateway

IN_A_ROUND = (RepairState.ASKING, RepairState.NEGOTIATING, RepairState.WATCHING)


class GroupRepair(LoneRepair):
    """Asks for places, elects, flies one step back; the gateway's place is the second choice."""

    def start(self, mesh: RepairActions) -> None:
        """Called once, before any other call."""
        super().start(mesh)
        self._election = Election(mesh.bids_within_s)
        self._news = FlightNews()
        self._credit = BidCredit()
        self._asked_s = -math.inf
        self._places_within_s = mesh.medium.stretched(PLACES_WITHIN_S)
        self._rounds_without_flier = 0

    @abc.abstractmethod
    def _score(self, step: Step) -> float:
        """The bid to fly `step`: 0 or more, or NO_BID. The highest of the group flies."""

    def patience(self, silent: bool) -> float:
        """After a flight of a drone of the group, later rounds come sooner, until none flies."""
        patience = super().patience(silent)
        may_fly = self._news.drone_flew and self._rounds_without_flier <= ROUNDS_WITHOUT_FLIER
        return LATER_ROUNDS if may_fly and not silent and patience == 1.0 else patience

    def on_emergency(self) -> None:
        """With neighbours: start an election. Alone: fly.

        Those who wait for a drone in flight do not bid meanwhile, so an election that would be over
        before they do does not start.
        """
        mesh = self.mesh
        if self.is_away:
            self.on_time_alone()
        elif mesh.neighbours():
            is_brief = mesh.bids_within_s < TAKE_OFF_WITHIN_S
            if not (is_brief and self._news.is_quiet(mesh.now_s)):
                self._ask_for_places()
        else:
            self.on_emergency_alone()

    def fly_alone(self) -> None:
        """Fly one step, and come back if no node is heard there. After the last step, begin again.

        Each time it looks at the place of one more node first: that one may have a gateway.
        A drone that flies to the gateway, as after an order, looks for it on the way: it need not.
        """
        mesh, here = self.mesh, self.mesh.own_place()
        mesh.happened(RouterEvent.NO_NEIGHBOURS)
        step, self.reason = self._next_step(alone=True)
        if step is None and self._was_everywhere:
            if mesh.is_unheard():
                self.reason = "hears others and is not heard: its transmitter may be broken"
                return
            step = self.beside_another()
            if step is None:
                self._was_everywhere = False
                mesh.try_again()
                step, self.reason = self._next_step(alone=True)
        if step is None:
            self._was_everywhere = not mesh.why_not_fly()
            return
        if here is not None and (mesh.silent or not step.home):
            self._look(step, here)
        else:
            self._fly(step)

    def on_gateway_found(self) -> None:
        """The election is over; places tried without success may be tried again."""
        super().on_gateway_found()
        self._election.clear()
        self._rounds_without_flier = 0
        self._news = FlightNews()
        self._credit.clear()

    def on_stopped(self) -> None:
        """The election continues without this node."""
        super().on_stopped()
        self._election.clear()

    def on_neighbour_lost(self, node: int) -> None:
        """Stop waiting for the place or the bid of a lost neighbour."""
        super().on_neighbour_lost(node)
        if self.mesh.state in (RepairState.ASKING, RepairState.NEGOTIATING):
            self.mesh.wait_until(self.mesh.now_s)

    def on_place(self, node: int, place: Location) -> None:
        """End the wait for places if this was the last missing answer."""
        if self.mesh.state is RepairState.ASKING and self._all_answered():
            self._negotiate()

    def on_time(self) -> None:
        """The time for places, bids or the winner's take-off is over."""
        if self.on_time_alone():
            return
        state = self.mesh.state
        if state is RepairState.ASKING:
            until_s = self._asked_s + self._places_within_s
            if self._all_answered() or self.mesh.now_s >= until_s:
                self._negotiate()
            else:
                self.mesh.wait_until(until_s)
        elif state is RepairState.NEGOTIATING:
            self._decide()
        elif state is RepairState.WATCHING:
            self._pass_over_winner()

    # Where to --------------------------------------------------------------------------------

    def _next_step(self, alone: bool) -> tuple[Step | None, str]:
        """The next flight, or None and the reason."""
        mesh = self.mesh
        why_not = mesh.why_not_fly()
        if why_not:
            return None, f"cannot fly: {why_not}"
        reason = "knows no place to fly to"
        is_first_choice = True
        steps, now_s = mesh.steps, mesh.now_s
        near_m = max(mesh.range_m / 2, 2 * PITCH * mesh.clearance_m)  # a gateway would answer there
        for step in steps:
            if step.owner == NO_ROUTE and len(steps) > 1 and not (alone and self._was_everywhere):
                continue
            is_due_again = step.home and not alone and self._is_home_due_again(step, near_m)
            if mesh.was_at(step) and not is_due_again:
                if is_first_choice:
                    reason = f"flew to the place of {step.owner} without success"
                    if step.owner == NO_ROUTE:
                        reason = "is where it was connected last, and knows no other place"
                continue
            occupant = NO_ROUTE if alone else self._occupant(step)
            if occupant != NO_ROUTE and not (step.home and occupant in self._news.in_vain()):
                reason = f"the place of {step.owner} is occupied by {occupant}"
            elif step.home and not alone and self._news.is_tried(step.place, now_s, near_m):
                reason = "another drone flew to the gateway without success"
            elif is_first_choice or self._rounds_without_flier >= ROUNDS_WITHOUT_FLIER:
                return step, ""
            is_first_choice = False
        return None if alone else self._next_look(), reason

    def _is_home_due_again(self, home: Step, near_m: float) -> bool:
        """Whether nobody has looked for the gateway for long, which may only have been off.

        The others may be unable to fly there. Who stands near would hear it.
        """
        mesh, here = self.mesh, self.mesh.own_place()
        is_far = here is not None and home.place.distance_m(here) > near_m
        return is_far and mesh.now_s >= self._news.home_s + self._rounds_s(HOME_FAILED_ROUNDS)

    def _next_look(self) -> Step | None:
        """To a node that is not of its group, after it was at the gateway's place in vain.

        Rarely, and in turns with the flights to the gateway, which may only be off.
        """
        mesh, news = self.mesh, self._news
        rounds = LOOKS_AFTER + (0 if news.in_vain() else HOME_FAILED_ROUNDS)
        is_due = mesh.now_s >= news.flew_s + self._rounds_s(rounds)
        was_home = any(step.home and mesh.was_at(step) for step in mesh.steps)
        if not (is_due and was_home) or mesh.own_place() is None:
            return None
        looks = self.beside_strangers(news.goals)
        return next((look for look in looks if self._occupant(look) == NO_ROUTE), None)

    def _occupant(self, step: Step) -> int:
        """A reachable node at the goal of `step`, or the owner of that place; else NO_ROUTE.

        Who stands beside the gateway for two rounds and has none: its link may have failed.
        """
        mesh = self.mesh
        if step.owner in mesh.neighbours():
            return step.owner
        radius_m = mesh.clearance_m * (2 * PITCH if step.home else NEAR)
        stays = self._rounds_without_flier >= ROUNDS_WITHOUT_FLIER
        for node, view in mesh.reachable().items():
            if node == step.owner and view.age_s <= mesh.now_s - self._asked_s:
                return node
            if step.home and stays and view.hops == NO_ROUTE:
                continue
            if (
                view.place is not None
                and view.age_s < OCCUPIED_FOR_S
                and view.place.distance_m(step.place) < radius_m
            ):
                return node
        return NO_ROUTE

    def _is_second_choice(self, step: Step) -> bool:
        """Those who had a link to the gateway itself look for it first, and the others after them.

        If one of these has looked in vain, its link may have failed, as theirs: then the others.
        """
        others = self.mesh.lost_next_hop not in (step.owner, NO_ROUTE)
        return step.home and others is not bool(self._news.in_vain())

    # Election --------------------------------------------------------------------------------

    def _ask_for_places(self) -> None:
        mesh = self.mesh
        mesh.happened(RouterEvent.ASKED_FOR_PLACES)
        self._asked_s = mesh.now_s
        mesh.wait_until(self._asked_s + self._places_within_s)
        mesh.ask_places()
        owner = mesh.lost_next_hop
        if mesh.reaches(owner) and owner not in mesh.neighbours():
            mesh.ask_place(owner)

    def _all_answered(self) -> bool:
        """Whether all neighbours, and the node whose place it wants, have sent their places."""
        mesh = self.mesh
        waited_s = mesh.now_s - self._asked_s
        asked = dict(mesh.neighbours())
        owner = mesh.lost_next_hop
        if owner not in asked and mesh.reaches(owner):
            view = mesh.reachable().get(owner)
            if view is None or view.age_s > waited_s:
                return False
        return all(view.age_s <= waited_s for view in asked.values())

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """A node of the group bids for the flight or took off; `from_` sent or relayed that."""
        if score in (TOOK_OFF, TOOK_OFF_HOME):
            self._on_take_off_of(node, score, from_, about)
            return
        if self.is_away:
            return
        mesh = self.mesh
        if score == HOME_FAILED:
            self._on_home_failed(node, from_, about)
            score = NO_BID
        most = highest_plausible(mesh.own_place(), mesh.gateway_place, mesh.range_m)
        if not self._credit.believes(node, score, from_, most):
            if self._election.knows(node):
                return  # another neighbour may bring the bid itself; in turns, both would be news
            score = NO_BID
        is_best = self._election.heard(node, score, mesh.now_s)
        if mesh.connected or mesh.state is RepairState.FLYING or self._news.is_quiet(mesh.now_s):
            return
        if is_best:
            mesh.bid(score, node, but_not_to=from_)
        if mesh.state is RepairState.LOST:
            self._ask_for_places()
        elif mesh.state is RepairState.NEGOTIATING:
            self._decide()

    def _negotiate(self) -> None:
        mesh = self.mesh
        self.group.update(mesh.reachable())
        step, self.reason = self._next_step(alone=False)
        self.own_bid = NO_BID if step is None else LOOKS if step.look else self._score(step)
        self.bids_for = NO_ROUTE if step is None else step.owner
        mesh.report(MeshEventKind.NEGOTIATION_STARTED, detail=f"score {self.own_bid:.2f}")
        mesh.happened(RouterEvent.BID)
        self._begin_election()

    def _begin_election(self) -> None:
        mesh = self.mesh
        score = as_on_the_air(self.own_bid)
        settled_s = max(mesh.now_s, self._asked_s + self._places_within_s)
        settled_s += mesh.medium.stretched(SETTLE_S)
        self._election.start(mesh.node_id, score, mesh.now_s, settled_s)
        tried = [step.place for step in mesh.steps if step.home and mesh.was_at(step)]
        if score < 0 and tried:
            mesh.bid(HOME_FAILED, about=tried[0])
        else:
            mesh.bid(score)
        self._decide()

    def _decide(self) -> None:
        mesh = self.mesh
        if mesh.state is not RepairState.NEGOTIATING:
            return
        due_s = self._election.due_s(mesh.neighbours().keys())
        if mesh.now_s < due_s:
            mesh.wait_until(due_s)
            return
        winner = self._election.winner()
        mesh.report(MeshEventKind.NEGOTIATION_ENDED, NO_ROUTE if winner is None else winner)
        if winner is None:
            self._rounds_without_flier += 1
            self._end_round()
        elif winner != mesh.node_id:
            self.winner = winner
            mesh.happened(RouterEvent.BIDS_COUNTED)
            mesh.wait_until(mesh.now_s + TAKE_OFF_WITHIN_S)
        else:
            step, self.reason = self._next_step(alone=False)
            self._end_round()
            if step is not None:
                mesh.bid(TOOK_OFF_HOME if step.home else TOOK_OFF, about=mesh.goal_of(step))
                here = mesh.own_place()
                if step.look and here is not None:
                    self._news.flew_s = mesh.now_s
                    self._look(step, here)
                else:
                    self._fly(step)

    def _on_take_off_of(self, node: int, code: float, from_: int, about: Location | None) -> None:
        """A drone of the group flies: wait for the outcome."""
        mesh = self.mesh
        if mesh.connected or self._news.is_quiet(mesh.now_s):
            return
        patience_s = LATER_ROUNDS * mesh.connection_lost_after_s
        quiet_s = max(patience_s - mesh.check_period_s, TAKE_OFF_WITHIN_S)
        self._news.took_off(mesh.now_s, mesh.now_s + quiet_s)
        self._rounds_without_flier = 0
        self.reason = f"{node} flies instead"
        if code == TOOK_OFF_HOME:
            self._news.home_s = mesh.now_s
            self._news.tries(about or mesh.gateway_place, mesh.now_s, HOME_AGAIN_S)
        elif about is not None and may_be_flown_to(about):
            self._news.goals.append(about)
        mesh.bid(code, node, but_not_to=from_, about=about)
        if mesh.state in IN_A_ROUND:
            self._end_round()

    def _on_home_failed(self, node: int, from_: int, about: Location | None) -> None:
        """A drone found no gateway at the gateway's place: no other of the group flies there."""
        mesh = self.mesh
        where, again_s = about or mesh.gateway_place, TAKE_OFF_WITHIN_S
        rounds_s = self._rounds_s(HOME_FAILED_ROUNDS)
        if not mesh.connected and self._news.failed(node, where, mesh.now_s, rounds_s, again_s):
            mesh.bid(HOME_FAILED, node, but_not_to=from_, about=about)

    def _rounds_s(self, rounds: int) -> float:
        """How long so many rounds take at most."""
        return rounds * (self.mesh.connection_lost_after_s + self.mesh.check_period_s)

    def _pass_over_winner(self) -> None:
        """The winner did not take off: the next best bid wins."""
        self._credit.did_not_fly(self.winner)
        self._election.pass_over(self.winner)
        self.mesh.happened(RouterEvent.WINNER_MISSED)
        self._begin_election()

    def _fly(self, step: Step) -> None:
        self._news.flew_s = self.mesh.now_s
        if step.home:
            self._news.home_s = self.mesh.now_s
        self.mesh.fly(step)

    def _end_round(self) -> None:
        self._election.clear()
        self.mesh.end_round()
