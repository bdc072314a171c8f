"""Policies: a learned function decides where a router's drone flies, or which neighbour is next.

A policy is a repair strategy or a routing technique. It observes what its node knows, as numbers;
`decide` makes an action of them. docs/rl.md shows how to train one and to compare it.
"""

from __future__ import annotations

import abc
import math
from typing import Any, ClassVar, Iterable

import numpy as np

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.interfaces import IRepairStrategy, RepairActions, Step
from drone_mesh.communication.routing.interfaces import IRoutingEssentials
from drone_mesh.communication.routing.techniques.gateway_routes import WORST_ETX, GatewayRoutes
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location

SLOTS = 8  # observed neighbours, the nearest
FAR = 10.0  # numbers of an observation lie within +-FAR
LEG = 0.5  # of the range: the longest flight of one action, as in the strategy `field`
LOOK_S = 2.0  # after a flight: to hear places, bids and a gateway, as in the strategy `field`
STAY_S = 5.0  # between two decisions of a drone that stays
OLD_S = 60.0  # the age of a place is observed relative to this


class Policy(abc.ABC):
    """What a decision is made of, and what it does. An environment decides if `commanded`."""

    OBSERVED: ClassVar[int]  # numbers in an observation
    ACTIONS: ClassVar[int]  # 0: an action is two numbers in -1..1; otherwise one in 0..ACTIONS - 1
    STEP_S: ClassVar[float]  # least time between two actions
    commanded = False
    node_id = NO_ROUTE  # of its node, once that has started

    @property
    @abc.abstractmethod
    def may_act(self) -> bool:
        """Whether an action has an effect now."""

    @abc.abstractmethod
    def observe(self) -> np.ndarray:
        """What its node knows: OBSERVED numbers."""

    @abc.abstractmethod
    def act(self, action: Any) -> None:
        """Carry out an action, if it may act."""

    def decide(self, observation: np.ndarray) -> Any:
        """The action for an observation. To be defined by whoever runs it without environment."""
        raise NotImplementedError(f"{type(self).__name__} decides nothing")


class PlacementPolicy(Policy, IRepairStrategy):
    """An action is a flight of a drone without a gateway: its share of LEG to the east and north.

    A flight shorter than the clearance is none. Observed: may it act, has it a gateway, can it fly,
    its bid; the gateway's last known place and that of its lost next hop (known or not, x, y); and
    of each neighbour: whether there is one, whether its place is known, x, y, the age of the place,
    hops to its gateway (1: none), and its bid. Places are relative to its own, in ranges. A bid is
    1 for a drone at the place of its lost next hop, and less the farther it is away.
    """

    OBSERVED = 4 + 6 + 7 * SLOTS
    ACTIONS = 0
    STEP_S = 1.0

    def start(self, mesh: RepairActions) -> None:
        super().start(mesh)
        self.node_id = mesh.node_id
        self._waits = self._is_ready = False
        self._bids: dict[int, float] = {}

    @property
    def may_act(self) -> bool:
        flies = self.mesh.state is RepairState.FLYING
        return self._is_ready and not (self.mesh.connected or flies)

    def on_emergency(self) -> None:
        """Look around, unless it does so already."""
        if not (self._waits or self._is_ready):
            self._look(LOOK_S)

    def on_landed(self) -> None:
        if not self.mesh.connected:
            self._look(LOOK_S)

    def on_stopped(self) -> None:
        self._waits = self._is_ready = False

    def on_gateway_found(self) -> None:
        """The next loss is a new one."""
        self._waits = self._is_ready = False
        self._bids.clear()

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """Remember it for the observation."""
        self._bids[node] = score

    def on_time(self) -> None:
        self._waits, self._is_ready = False, True
        if self.may_act and not self.commanded:
            self.act(self.decide(self.observe()))

    def act(self, action: Any) -> None:
        """Fly, or stay and look around again."""
        mesh, here = self.mesh, self.mesh.own_place()
        if not self.may_act:
            return
        self._is_ready = False
        self.reason = mesh.why_not_fly() or ("" if here is not None else "does not know its place")
        east, north = (LEG * mesh.range_m * float(np.clip(share, -1.0, 1.0)) for share in action)
        flies = math.hypot(east, north) >= mesh.clearance_m  # not if it is no number
        if not self.reason and not flies:
            self.reason = "its policy lets it stay"
        if self.reason or here is None:
            self._look(STAY_S)
        else:
            goal = Location(here.latitude + north, here.longitude + east, here.height)
            mesh.fly(Step(goal), until_connected=True)

    def observe(self) -> np.ndarray:
        mesh, here = self.mesh, self.mesh.own_place()
        lost = next((step.place for step in mesh.steps if step.owner == mesh.lost_next_hop), None)
        flags = (self.may_act, mesh.connected, not mesh.why_not_fly())
        numbers = [*map(float, flags), self._own_bid()]
        for place in (mesh.gateway_place, lost):
            numbers += _relative(here, place, mesh.range_m)
        views = mesh.neighbours()
        for node in _nearest(here, {node: view.place for node, view in views.items()}):
            view = views[node]
            age = min(view.age_s / OLD_S, 1.0)
            numbers += [1.0, *_relative(here, view.place, mesh.range_m), age, _hops(view.hops)]
            numbers.append(self._bids.get(node, 0.0))
        return _as_observation(numbers, self.OBSERVED)

    def _look(self, seconds: float) -> None:
        self._waits = True
        self.mesh.ask_places()
        self.mesh.bid(self._own_bid())
        self.mesh.wait_until(self.mesh.now_s + seconds)

    def _own_bid(self) -> float:
        here, steps = self.mesh.own_place(), self.mesh.steps
        return 1.0 / (1.0 + here.distance_m(steps[0].place)) if here and steps else 0.0


class RoutingPolicy(Policy, GatewayRoutes):
    """An action is the next hop to the gateway: the number of an observed neighbour, from 1 on.

    0 stands for the next hop of ChildTableTree. Observed: has it a gateway, the gateway's last
    known place (known or not, x, y); and of each neighbour: whether there is one, whether its place
    is known, x, y, hops to its gateway (1: none), transmissions per packet to it, and whether it is
    the next hop.
    """

    OBSERVED = 4 + 7 * SLOTS
    ACTIONS = 1 + SLOTS
    STEP_S = 10.0  # the check period of MeshTiming
    RANGE_M = 10.0  # unit of observed places; a technique does not know the range

    def __init__(self) -> None:
        super().__init__()
        self._hops: dict[int, int] = {}  # of neighbours
        self._observed: list[int] = []  # neighbours, in the order of the latest observation
        self._next_hop = NO_ROUTE

    def start_routing(self, essentials: IRoutingEssentials) -> None:
        self.node_id = essentials.get_node_id()
        super().start_routing(essentials)

    @property
    def may_act(self) -> bool:
        return self._essentials.get_preferred_gateway() != self.node_id

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        if kind == MessageType.PRESENT:
            self._hops[from_] = messages.hops(payload)
        return super().learn(creator, from_, kind, payload)

    def maintain_routing(self) -> None:
        """Decide, then check the routes."""
        if self.may_act and not self.commanded:
            self.act(self.decide(self.observe()))
        super().maintain_routing()

    def act(self, action: Any) -> None:
        """Use this neighbour from now on."""
        at = int(action) - 1
        self._next_hop = self._observed[at] if 0 <= at < len(self._observed) else NO_ROUTE

    def next_hop_to_gateway(self, gateway: int) -> int:
        is_it = gateway == self._essentials.get_preferred_gateway()
        return self._next_hop if is_it and self._next_hop in self._children else NO_ROUTE

    def forget_neighbour(self, neighbour: int) -> None:
        self._hops.pop(neighbour, None)
        if neighbour == self._next_hop:
            self._next_hop = NO_ROUTE

    def forget_gateway(self, gateway: int) -> None:
        self._next_hop = NO_ROUTE

    def observe(self) -> np.ndarray:
        mesh = self._essentials
        here, gateway = mesh.own_place(), mesh.get_preferred_gateway()
        places = {node: mesh.place_of(node) for node in self.get_set_of_children()}
        self._observed = list(_nearest(here, places))
        numbers = [float(mesh.get_connected_to_gateway())]
        numbers += _relative(here, mesh.place_of(gateway), self.RANGE_M)
        used = self.get_direction_to_node(gateway)
        for node in self._observed:
            numbers += [1.0, *_relative(here, places[node], self.RANGE_M)]
            numbers += [_hops(self._hops.get(node, NO_ROUTE)), self.etx(node) / WORST_ETX]
            numbers.append(float(node == used))
        return _as_observation(numbers, self.OBSERVED)


def _relative(here: Location | None, place: Location | None, range_m: float) -> list[float]:
    """Whether a place is known, and where it is, in ranges to the east and north."""
    if here is None or place is None:
        return [0.0, 0.0, 0.0]
    away = (place.longitude - here.longitude, place.latitude - here.latitude)
    return [1.0, *(metres / range_m for metres in away)]


def _nearest(here: Location | None, places: dict[int, Location | None]) -> Iterable[int]:
    """SLOTS of these nodes, the nearest first; those without a place come last."""

    def distance(node: int) -> tuple[float, int]:
        place = places[node]
        return (math.inf if here is None or place is None else here.distance_m(place), node)

    return sorted(places, key=distance)[:SLOTS]


def _hops(hops: int) -> float:
    return min(hops / FAR, 1.0)


def _as_observation(numbers: list[float], length: int) -> np.ndarray:
    observation = np.zeros(length, np.float32)
    observation[: len(numbers)] = np.clip(numbers, -FAR, FAR)
    return observation
