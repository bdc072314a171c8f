"""Demonstration: arranges what a viewer can follow sentence by sentence, such as a repair.

It begins with any fleet, and puts it back as it was. For the repair five routers form layout 202
of 2019, scaled to the range of the radios: a chain of two, and behind it a group of three. Then the
second router of the chain is switched off.
"""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass
from typing import Callable, ClassVar, Sequence

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.put_back import (
    FAST,
    ORDER_AGAIN_S,
    FleetBefore,
    Order,
    Place,
    Places,
    PutBack,
    Returning,
    Script,
    attempt,
    away,
    fly,
    power,
    rounded,
    speed,
)
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import REPAIR_STATES, MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.repair_story import RepairStory, and_

# x, y from the gateway, in ranges of the radio: first the chain, then the group that loses it.
_PLACES = ((0.0, 4 / 9), (0.0, 12 / 9), (0.0, 18 / 9), (4 / 9, 15 / 9), (-3 / 9, 15 / 9))
_CHAIN = 2  # routers; the last of them is switched off
_TURNS = ((1, 0), (-1, 0), (0, 1), (0, -1))  # cosine and sine: ways in which the chain may point
_FREE_M = 1.5  # between its places and the drones that only watch
# Simulated, as all that follows: before, nodes are off that are about to start.
_STARTED_S = 5.0
_READY_WITHIN_S = 300.0  # a fleet may have to repair itself first
_SETTLE_S = 25.0  # two default check periods: each node has asked for its next hop's position
_REPAIR_WITHIN_S = 240.0
# Simulated seconds per second: waiting is sped up, and brief events are slowed down.
_WAITING, _BIDDING, _FLYING = 3.0, 0.2, 0.5
_SLOW_DOWN_S = 4.0  # before the wait ends, so that a slow page does not miss what follows


@dataclass(frozen=True)
class Casting:
    """The drones that take part in a demonstration, and the state of the fleet before it."""

    gateway: int
    cast: Sequence[int]  # five routers: the chain, and the group behind it
    places: Places  # of the cast
    resting: Sequence[int]  # the other nodes that are on: they are switched off meanwhile
    before: FleetBefore

    @classmethod
    def choose(cls, mesh: MeshStatus) -> Casting:
        """Choose the routers with the shortest routes. Raises OrderRefused if there are too few."""
        known = [node for node in mesh.nodes if position_is_known(node)]
        gateways = [node for node in known if node.role == Role.GATEWAY]
        gateways.sort(key=lambda node: (not node.on, node.id))
        able = [n for n in known if n.role == Role.ROUTER and not (n.why_not_fly or n.crashed)]
        if not gateways or len(able) < len(_PLACES):
            raise OrderRefused(
                f"this demonstration needs a gateway and {len(_PLACES)} routers that can fly"
            )
        able.sort(key=lambda node: (not node.connected, node.hops, node.id))
        cast = sorted(node.id for node in able[: len(_PLACES)])
        others = [node for node in known if node.id not in cast]
        resting = [n.id for n in mesh.nodes if n.on and n.id not in (gateways[0].id, *cast)]
        return cls(
            gateways[0].id,
            cast,
            dict(zip(cast, free_places(gateways[0], mesh.max_distance, others, _PLACES))),
            resting,
            FleetBefore.of(mesh, able),
        )

    def in_words(self) -> str:
        """The plan of the demonstration in words, for the user to agree to."""
        rest = f", and switches {len(self.resting)} others off" if self.resting else ""
        return (
            f"This sends drones {and_(self.cast)} to places beside gateway {self.gateway}{rest}. "
            f"Then it switches {self.cast[_CHAIN - 1]} off, and the mesh repairs itself. You can "
            "end it at any moment: it switches everything on again and sends all drones back."
        )


class Demonstration(abc.ABC):
    """Issues orders and describes what happens. Belongs to one thread, which carries them out."""

    casting: ClassVar[type[Casting]] = Casting

    def __init__(self) -> None:
        self.story = RepairStory()
        self.plan: Casting | None = None  # from the first state on
        self.is_over = False
        self.is_leaving = False  # it puts everything back
        self._script: Script = self._run()
        next(self._script)
        self._factor = 0.0  # ordered last; 0: none
        self._describes_repair = False  # flights before the repair also look like losses

    @abc.abstractmethod
    def _play(self, mesh: MeshStatus, plan: Casting) -> Script:
        """What it shows, from this state on."""

    def advance(self, mesh: MeshStatus) -> list[Order]:
        """The orders due in this state of the mesh.

        Raises OrderRefused if it cannot continue; then, and whenever it shall end, call `leave`.
        """
        if self._describes_repair:
            self.story.update(mesh)
        try:
            return self._script.send(mesh)
        except StopIteration:
            self.is_over = True
            return []

    def leave(self, why: str, now_s: float) -> None:
        """From now on put everything back: power, places and speed."""
        self.story.add(f"Not finished: {why}", now_s)
        self._script = self._put_back()
        next(self._script)

    def power_back(self) -> list[Order]:
        """The orders that at least leave no drone dark, if there is no time for flights."""
        if self.plan is None:
            return []
        orders = [power(node, True) for node in (*self.plan.resting, *self.plan.cast)]
        return [*orders, *([speed(self.plan.before.real_time_factor)] if self._factor else [])]

    def _run(self) -> Script:
        mesh = yield []
        while mesh.stamp_s < _STARTED_S:
            mesh = yield []
        self.plan = self.casting.choose(mesh)
        yield from self._play(mesh, self.plan)
        yield from self._put_back()

    def _put_back(self) -> Script:
        self._describes_repair, self.is_leaving = False, True
        if self.plan is None:
            yield []
        else:
            yield from PutBack(self.plan.before, self.plan.cast, self.story).play()

    def _bring(self, mesh: MeshStatus, places: Places) -> Returning:
        """Order these drones to their places, as often as it takes, and wait for them."""
        begun_s, due_s = mesh.stamp_s, dict.fromkeys(places, mesh.stamp_s)
        while gone := [node for node in mesh.nodes if away(node, places)]:
            if mesh.stamp_s > begun_s + _READY_WITHIN_S:
                lost = [node.id for node in gone if not node.connected]
                why = f", {and_(lost)} without a gateway" if lost else ""
                ids = and_(node.id for node in gone)
                raise OrderRefused(f"{ids} not there after {_READY_WITHIN_S:.0f} s{why}")
            orders = []
            for node in reversed(gone):  # those behind others first
                may_hear = node.connected and not len(node.path)
                if may_hear and mesh.stamp_s >= due_s[node.id]:
                    due_s[node.id] = mesh.stamp_s + ORDER_AGAIN_S
                    orders.append(attempt(fly(node.id, places[node.id])))
            mesh = yield orders
        return mesh

    def _until(
        self, mesh: MeshStatus, complaint: str, condition: Callable[[MeshStatus], bool]
    ) -> Returning:
        begun_s = mesh.stamp_s
        while not condition(mesh):
            if mesh.stamp_s > begun_s + _READY_WITHIN_S:
                raise OrderRefused(f"{complaint} after {_READY_WITHIN_S:.0f} s")
            mesh = yield []
        return mesh

    def _at_pace(self, factor: float) -> list[Order]:
        """The order that changes the speed, if it differs from the last one."""
        if factor == self._factor:
            return []
        self._factor = factor
        return [speed(factor)]


class RepairDemonstration(Demonstration):
    """A repair: the second router of a chain is switched off."""

    def _play(self, mesh: MeshStatus, plan: Casting) -> Script:
        chain, group = plan.cast[:_CHAIN], plan.cast[_CHAIN:]
        lost = chain[-1]
        self.story.add(
            f"The gateway sends five drones out: {and_(chain)} as a chain, {and_(group)} as a "
            "group behind it. The others stay on until they are there, because orders need routes",
            mesh.stamp_s,
        )
        dark = [node for node in (plan.gateway, *plan.cast) if node in plan.before.off]
        mesh = yield [*(power(node, True) for node in dark), *self._at_pace(FAST)]
        mesh = yield from self._bring(mesh, plan.places)
        if plan.resting:
            count = len(plan.resting)
            self.story.add(
                f"{count} other drone{'s' if count > 1 else ''} could provide another route, and "
                f"{'are' if count > 1 else 'is'} switched off during the demonstration",
                mesh.stamp_s,
            )
            mesh = yield [power(node, False) for node in plan.resting]
        mesh = yield from self._until(
            mesh,
            f"{and_(plan.cast)} are not all connected at their places",
            lambda m: (
                _are_connected(m, plan.cast) and not any(away(n, plan.places) for n in m.nodes)
            ),
        )
        settled_s = mesh.stamp_s + _SETTLE_S
        self.story.add(
            "All are connected. Each asks for the position of its next hop to the gateway, because "
            "it would fly to that place if the next hop fell silent: from there it must be heard",
            mesh.stamp_s,
            settled_s,
        )
        mesh = yield from self._until(
            mesh,
            "the routers do not know the places of their next hops",
            lambda m: m.stamp_s >= settled_s and _know_fallback(m, group, lost),
        )
        begun_s, self._describes_repair = mesh.stamp_s, True
        self.story.update(mesh)
        mesh = yield [power(lost, False), *self._at_pace(_WAITING)]
        yield from self._follow(mesh, group, begun_s)

    def _follow(self, mesh: MeshStatus, group: Sequence[int], begun_s: float) -> Script:
        """Describe the repair until the group is connected again, adapting the speed."""
        noticed = False
        while True:
            nodes = [node for node in mesh.nodes if node.id in group]
            noticed = noticed or not all(node.connected for node in nodes)
            if noticed and self.story.is_over and all(node.connected for node in nodes):
                return
            if mesh.stamp_s > begun_s + _REPAIR_WITHIN_S:
                raise OrderRefused(
                    f"{and_(group)} {_why_not(nodes)} after {_REPAIR_WITHIN_S:.0f} s "
                    f"(repair strategy: {mesh.repair_strategy or 'unknown'})"
                )
            mesh = yield self._at_pace(_pace(nodes))


def free_places(
    gateway: NodeStatus,
    range_m: float,
    others: Sequence[NodeStatus],
    places: Sequence[tuple[float, float]],
    up_m: float = 0.0,
) -> list[Place]:
    """These places beside the gateway, in the first direction where no other drone is near them.

    `places`: x, y from the gateway, in ranges; `up_m`: above it.
    """
    x, y, z = gateway.position

    def pointing(cos: int, sin: int) -> list[Place]:
        around = [(cos * dx - sin * dy, sin * dx + cos * dy) for dx, dy in places]
        return [rounded((x + dx * range_m, y + dy * range_m, z + up_m)) for dx, dy in around]

    def room_m(places: Sequence[Place]) -> float:
        free = (math.dist(at[:2], other.position[:2]) for at in places for other in others)
        return min(_FREE_M, min(free, default=_FREE_M))

    return max((pointing(*turn) for turn in _TURNS), key=room_m)


def _are_connected(mesh: MeshStatus, ids: Sequence[int]) -> bool:
    return all(node.connected and node.on for node in mesh.nodes if node.id in ids)


def _know_fallback(mesh: MeshStatus, group: Sequence[int], lost: int) -> bool:
    return all(node.fallback == lost for node in mesh.nodes if node.id in group)


def _pace(group: Sequence[NodeStatus]) -> float:
    states = {REPAIR_STATES[node.repair_state] for node in group}
    if RepairState.FLYING in states:
        return _FLYING
    if states & {RepairState.ASKING, RepairState.NEGOTIATING, RepairState.WATCHING}:
        return _BIDDING
    soon = any(node.emergency_in < _SLOW_DOWN_S for node in group)
    return _FLYING if soon else _WAITING


def _why_not(nodes: Sequence[NodeStatus]) -> str:
    places = {node.place_of for node in nodes} - {NO_ROUTE}
    return "have no gateway, although one flew" if places else "have no gateway, and none flew"
