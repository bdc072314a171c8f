"""RepairDemonstration: arranges a repair that a viewer can follow sentence by sentence.

Five routers form layout 202 of 2019, scaled to the range of the radios: a chain of two, and behind
it a group of three. Then the second router of the chain is switched off.
"""

from __future__ import annotations

from typing import Callable, Dict, Generator, List, Sequence, Tuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.router_states import RepairState
from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import REPAIR_STATES, MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.repair_story import RepairStory, and_

Order = Callable[[MeshControls], object]
Script = Generator[List[Order], MeshStatus, None]
Places = Dict[int, Tuple[float, float, float]]  # node -> x y z, m

# x, y from the gateway, in ranges of the radio: first the chain, then the group that loses it.
_PLACES = ((0.0, 4 / 9), (0.0, 12 / 9), (0.0, 18 / 9), (4 / 9, 15 / 9), (-3 / 9, 15 / 9))
_CHAIN = 2  # routers; the last of them is switched off
_READY_WITHIN_S = 120.0  # simulated, as all that follows: all connected at their places
_SETTLE_S = 25.0  # two default check periods: each node has asked for its next hop's position
_REPAIR_WITHIN_S = 240.0
# Simulated seconds per second: waiting is sped up, and brief events are slowed down.
_FAST, _WAITING, _BIDDING, _FLYING = 5.0, 3.0, 0.2, 0.5
_SLOW_DOWN_S = 4.0  # before the wait ends, so that a slow page does not miss what follows


class RepairDemonstration:
    """Issues orders and describes what happens. Belongs to one thread, which carries them out."""

    def __init__(self) -> None:
        self.story = RepairStory()
        self._script: Script = self._play()
        next(self._script)
        self._factor = 0.0  # ordered last; 0: none
        self._factor_before = 0.0
        self._resting: list[int] = []  # nodes switched off so that only five take part
        self._describes_repair = False  # flights before the repair also look like losses
        self.is_over = False

    def advance(self, mesh: MeshStatus) -> list[Order]:
        """The orders due in this state of the mesh. Raises OrderRefused if it cannot continue.

        Once it is over, only `leave` returns further orders.
        """
        if self._describes_repair:
            self.story.update(mesh)
        try:
            return self._script.send(mesh)
        except StopIteration:
            self.is_over = True
            return []

    def leave(self) -> list[Order]:
        """The orders that undo its changes: the speed, and the drones that were switched off."""
        orders = [_power(node_id, True) for node_id in self._resting]
        if self._factor:
            orders.append(_speed(self._factor_before))
        return orders

    def _play(self) -> Script:
        mesh = yield []
        self._factor_before = mesh.real_time_factor
        gateway, cast = _choose_cast(mesh)
        chain, group = cast[:_CHAIN], cast[_CHAIN:]
        lost = chain[-1]
        orders = self._cast_orders(mesh, gateway, cast)
        mesh = yield [*orders, *self._at_pace(_FAST)]
        mesh = yield from self._until(
            mesh, "the drones are not all connected", _READY_WITHIN_S, lambda m: _ready(m, cast)
        )
        self.story.add(
            f"The gateway sends five drones out: {and_(chain)} as a chain, {and_(group)} as a "
            "group behind it",
            mesh.stamp_s,
        )
        goals = _goals(mesh, gateway, cast)
        mesh = yield [_fly(node_id, *goals[node_id]) for node_id in reversed(cast)]
        mesh = yield from self._until(
            mesh,
            "the drones are not all connected at their places",
            _READY_WITHIN_S,
            lambda m: _ready(m, cast) and _stand_at(m, goals),
        )
        settled_s = mesh.stamp_s + _SETTLE_S
        self.story.add(
            "All are connected. Each asks for the position of its next hop to the gateway, because "
            "it would fly to that place",
            mesh.stamp_s,
            settled_s,
        )
        mesh = yield from self._until(
            mesh,
            "the routers do not know the places of their next hops",
            _READY_WITHIN_S,
            lambda m: m.stamp_s >= settled_s and _know_fallback(m, group, lost),
        )
        begun_s, self._describes_repair = mesh.stamp_s, True
        self.story.update(mesh)
        mesh = yield [_power(lost, False), *self._at_pace(_WAITING)]
        yield from self._follow(mesh, group, begun_s)

    def _cast_orders(self, mesh: MeshStatus, gateway: int, cast: Sequence[int]) -> list[Order]:
        """Switch the cast on and all other nodes off."""
        self._resting = [n.id for n in mesh.nodes if n.on and n.id not in (gateway, *cast)]
        if self._resting:
            count = len(self._resting)
            self.story.add(
                f"{count} other drone{'s' if count > 1 else ''} could provide another route, and "
                f"{'are' if count > 1 else 'is'} switched off during the demonstration",
                mesh.stamp_s,
            )
        orders = [_power(node_id, False) for node_id in self._resting]
        return [*orders, *(_power(n.id, True) for n in mesh.nodes if n.id in cast and not n.on)]

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
                    f"{and_(group)} {_why_not(nodes)} after {_REPAIR_WITHIN_S:.0f} s: the "
                    f"demonstration ends (repair strategy: {mesh.repair_strategy or 'unknown'})"
                )
            mesh = yield self._at_pace(_pace(nodes))

    def _until(
        self,
        mesh: MeshStatus,
        complaint: str,
        within_s: float,
        condition: Callable[[MeshStatus], bool],
    ) -> Generator[list[Order], MeshStatus, MeshStatus]:
        begun_s = mesh.stamp_s
        while not condition(mesh):
            if mesh.stamp_s > begun_s + within_s:
                raise OrderRefused(f"{complaint} after {within_s:.0f} s: the demonstration ends")
            mesh = yield []
        return mesh

    def _at_pace(self, factor: float) -> list[Order]:
        """The order that changes the speed, if it differs from the last one."""
        if factor == self._factor:
            return []
        self._factor = factor
        return [_speed(factor)]


def _choose_cast(mesh: MeshStatus) -> tuple[int, list[int]]:
    """The gateway and the five routers that take part. Raises OrderRefused."""
    gateways = [n.id for n in mesh.nodes if n.role == Role.GATEWAY and position_is_known(n)]
    routers = [n.id for n in mesh.nodes if n.role == Role.ROUTER and position_is_known(n)]
    if not gateways or len(routers) < len(_PLACES):
        raise OrderRefused(f"this demonstration needs a gateway and {len(_PLACES)} routers")
    return gateways[0], routers[: len(_PLACES)]


def _goals(mesh: MeshStatus, gateway: int, cast: Sequence[int]) -> Places:
    x, y, z = next(node.position for node in mesh.nodes if node.id == gateway)
    return {
        node_id: (
            round(x + dx * mesh.max_distance, 2),
            round(y + dy * mesh.max_distance, 2),
            max(0.0, round(z)),
        )
        for node_id, (dx, dy) in zip(cast, _PLACES)
    }


def _ready(mesh: MeshStatus, cast: Sequence[int]) -> bool:
    return all(n.connected and n.on and not len(n.path) for n in mesh.nodes if n.id in cast)


def _stand_at(mesh: MeshStatus, goals: Places) -> bool:
    return all(
        max(abs(a - b) for a, b in zip(node.position[:2], goals[node.id])) < 0.2
        for node in mesh.nodes
        if node.id in goals
    )


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


def _power(node_id: int, on: bool) -> Order:
    return lambda controls: controls.power(node_id, on)


def _fly(node_id: int, x: float, y: float, z: float) -> Order:
    return lambda controls: controls.fly(node_id, x, y, z, allow_shared_place=True)  # others leave


def _speed(factor: float) -> Order:
    return lambda controls: controls.speed(False, factor)
