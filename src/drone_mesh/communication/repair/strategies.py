"""The repair strategies that come with drone_mesh, by name; docs/strategies.md compares them."""

from __future__ import annotations

import math
from typing import Callable

from drone_mesh.by_name import create_by_name
from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.repair.c3r import C3R
from drone_mesh.communication.repair.election import MAX_SCORE_M, NO_BID
from drone_mesh.communication.repair.fiedler import Fiedler
from drone_mesh.communication.repair.group_repair import GroupRepair
from drone_mesh.communication.repair.interfaces import IRepairStrategy, Step
from drone_mesh.communication.repair.legs import LEG, LegByLeg
from drone_mesh.communication.repair.named_backup import NamedBackup
from drone_mesh.communication.repair.nearest import Nearest
from drone_mesh.communication.repair.options import DEFAULT_REPAIR
from drone_mesh.communication.repair.spots import WITHIN_REACH
from drone_mesh.communication.repair.virtual_spring import VirtualSpring
from drone_mesh.drone.location import Location

TO_NEIGHBOURS = 0.1  # weight of the neighbours against the gateway, as in MDSG-APF
MOVES = 2  # towards one lost next hop
WAITS = 6  # checks; the drones beside the dead node have moved twice by then


class Stay(IRepairStrategy):
    """No drone ever flies, until the routing finds a gateway: the baseline for the others."""

    def on_emergency(self) -> None:
        """Nothing."""
        self.reason = "its strategy never flies"


class Home(IRepairStrategy):
    """Each drone without a gateway flies straight to the gateway, once, until it is connected.

    The simplest rule there is: fast, needs no agreement, and gives up the layout. "Centering" of
    the literature, with the gateway as the centre (Mou et al., IEEE JSAC 40(1), 2022).
    """

    def on_emergency(self) -> None:
        """Fly, if there is a step that has not failed yet."""
        mesh = self.mesh
        self.reason = mesh.why_not_fly()
        home = [step for step in mesh.steps if step.home]
        if not home:
            self.reason = self.reason or "does not know where the gateway is"
        elif mesh.was_at(home[0]):
            self.reason = self.reason or "flew to the gateway's place without success"
        if not self.reason:
            mesh.fly(home[0])


class Inward(Home):
    """All neighbours of the lost next hop move towards its place, by half the range at most.

    After RIM: Younis, Lee, Abbasi, "A Localized Algorithm for Restoring Internode Connectivity in
    Networks of Moveable Sensors", IEEE TC 59(12), 2010. Only the parts without a gateway move, so
    one move may not suffice: a second one leads to the place itself, and a third flight to the
    gateway. No election; others follow their neighbours.
    """

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


class Field(LegByLeg):
    """Each drone moves a little towards its neighbours, and a lot towards the gateway.

    Leg by leg, until a gateway answers or the gateway's place is reached. After MDSG-APF (Mou et
    al.) and HERO (Mi, Yang, Liu, ICRA 2011), reduced to what a node knows of its neighbours, with
    the gateway's place as the centre of the field.
    """

    _nearest_m = math.inf  # to the gateway's place, since the connection was lost

    def on_gateway_found(self) -> None:
        """Forget the distance reached: the next loss starts over."""
        self._nearest_m = math.inf

    def _goal(self, here: Location, gateway: Location) -> Location | None:
        mesh = self.mesh
        views = mesh.neighbours().values()
        places = [view.place for view in views if view.place is not None] or [here]
        middle = Location(*(sum(axis) / len(places) for axis in zip(*places)))
        goal = gateway.towards(middle, TO_NEIGHBOURS * gateway.distance_m(middle))
        away_m = here.distance_m(gateway)
        if away_m > self._nearest_m - mesh.clearance_m:
            self.reason = "came no nearer to the gateway"
            return None
        self._nearest_m = away_m
        return here.towards(goal, min(LEG * mesh.range_m, here.distance_m(goal)))


class Follow(Nearest):
    """A leader, the nearest, takes the place of its lost next hop; its tree moves up behind it.

    After LeDiR: Abbasi, Younis, Baroudi, "Recovering From a Node Failure in Wireless Sensor-Actor
    Networks With Minimal Topology Changes", IEEE TVT 62(1), 2013, with the routes to the gateway as
    the tree. Each drone announces where it will stand before it leaves, and one whose next hop
    moves out of reach flies until it is in reach again.
    """

    def on_place(self, node: int, place: Location) -> None:
        """If the next hop moves away, follow it as far as needed."""
        mesh, here = self.mesh, self.mesh.own_place()
        may_follow = not (mesh.connected or mesh.why_not_fly() or mesh.state is RepairState.FLYING)
        if node != mesh.lost_next_hop or here is None or not may_follow:
            super().on_place(node, place)
        elif here.distance_m(place) > WITHIN_REACH * mesh.range_m:
            self._fly(Step(place.towards(here, WITHIN_REACH * mesh.range_m), node))
        else:
            super().on_place(node, place)

    def _fly(self, step: Step) -> None:
        self.mesh.announce_place(self.mesh.goal_of(step))
        super()._fly(step)


class Thesis(GroupRepair):
    """The farthest drone flies one step back; the nearest, if it is to the gateway's place.

    The rule of the Software Design Document of 2019, corrected; docs/repair.md, "Negotiation".
    """

    bid_unit = "m"

    def _score(self, step: Step) -> float:
        """Distance to the gateway's place in metres.

        Without one, as while its mesh passes from one gateway to another: to where it would fly.
        For the second choice the nearest drone flies, unless another one has a first choice.
        """
        here = self.mesh.own_place()
        if here is None:
            self.reason = "does not know where it is"
            return NO_BID
        distance_m = min(here.distance_m(self.mesh.gateway_place or step.place), MAX_SCORE_M)
        return 1.0 / (1.0 + distance_m) if self._is_second_choice(step) else distance_m


REPAIR_STRATEGIES: dict[str, Callable[[], IRepairStrategy]] = {
    DEFAULT_REPAIR: Thesis,
    "c3r": C3R,
    "fiedler": Fiedler,
    "field": Field,
    "follow": Follow,
    "home": Home,
    "inward": Inward,
    "named_backup": NamedBackup,
    "nearest": Nearest,
    "stay": Stay,
    "virtual_spring": VirtualSpring,
}


def create_repair_strategy(chosen: str | Callable[[], IRepairStrategy]) -> IRepairStrategy:
    """A new strategy: a name in REPAIR_STRATEGIES, "package.module:Class" or a class.

    Raises ConfigurationError, with the known names, for anything else.
    """
    return create_by_name("repair strategy", chosen, REPAIR_STRATEGIES, IRepairStrategy)
