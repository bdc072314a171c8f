"""PutBack: leaves a fleet as it was before a demonstration, and says so only when it is so.

Whoever is to fly home needs a route for that order. So nobody leaves while one of them is out of
contact, and a relay waits until those behind it are home.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from typing import Callable, Collection, Dict, Generator, List, Sequence, Tuple

from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.state.model import MeshStatus, NodeStatus
from drone_mesh.state.repair_story import RepairStory, and_

Order = Callable[[MeshControls], object]
Script = Generator[List[Order], MeshStatus, None]
Returning = Generator[List[Order], MeshStatus, MeshStatus]
Place = Tuple[float, float, float]  # x y z, m
Places = Dict[int, Place]  # by node

FAST = 5.0  # simulated seconds per second
ORDER_AGAIN_S = 5.0  # simulated, as all that follows: a drone that had no route may have one then
_WITHIN_S = 300.0  # at the speed FAST a minute of wall time
_HOLD_S = 120.0  # for whoever needs a route: twice the time in which the mesh repairs itself
_LAST_FLIGHTS_S = 100.0  # what is left of _WITHIN_S for the drones that only watched
_SHOWN_WITHIN_S = 10.0  # the last orders, in the state of the mesh
_AT_PLACE_M = 0.5
_NAMED = 3  # differences in one sentence


@dataclass(frozen=True)
class FleetBefore:
    """What the fleet was like. A node that has been removed since is not missed."""

    on: Collection[int]
    off: Collection[int]
    connected: Collection[int]
    homes: Places  # of all routers that could fly; in flight: its goal
    real_time_factor: float

    @classmethod
    def of(cls, mesh: MeshStatus, able: Sequence[NodeStatus]) -> FleetBefore:
        """The fleet as it is now; `able`: the routers that can fly."""
        return cls(
            {node.id for node in mesh.nodes if node.on},
            {node.id for node in mesh.nodes if not node.on},
            {node.id for node in mesh.nodes if node.on and node.connected},
            {n.id: rounded(n.path[-3:] if len(n.path) else n.position) for n in able},
            mesh.real_time_factor,
        )

    def differences(self, mesh: MeshStatus) -> list[str]:
        """What is not as it was, and what a user can do about it."""
        found = [self._difference(node) for node in mesh.nodes]
        if not math.isclose(mesh.real_time_factor, self.real_time_factor, rel_tol=1e-3):
            found.append(
                f"the speed is {mesh.real_time_factor:g} instead of {self.real_time_factor:g}: "
                "choose it in the top line"
            )
        return [words for words in found if words]

    def _difference(self, node: NodeStatus) -> str:
        if node.on != (node.id in self.on) and node.id in {*self.on, *self.off}:
            word = "off" if node.on else "on"
            return f"{node.id} is {'on' if node.on else 'off'}: switch it {word}"
        if away(node, self.homes):
            x, y, z = self.homes[node.id]
            where = f"{node.id} is {_from_home_m(node, self.homes):.0f} m from its place"
            if node.crashed or node.why_not_fly:
                return f"{where} and cannot fly: {node.why_not_fly or 'it has crashed'}"
            send = f"send it to x {x:g}, y {y:g}, z {z:g} m"
            if node.connected:
                return f"{where}: {send}"
            return f"{where} and has no route: send another one near it, then {send[5:]}"
        if node.id in self.connected and not node.connected:
            return f"{node.id} is at its place without a gateway: select it to see what it does"
        return ""


class PutBack:
    """Issues the orders that put a fleet back, and adds what happens to the story."""

    def __init__(self, before: FleetBefore, cast: Sequence[int], story: RepairStory) -> None:
        """`cast`: the drones that were sent away; all others were at most switched off."""
        self._before, self._cast, self._story = before, cast, story
        self._due_s: dict[tuple[str, int], float] = {}  # power or fly, and node: when again
        self._begun_s = math.inf

    def play(self) -> Script:
        """The orders due in each state."""
        mesh = yield []
        before, self._begun_s = self._before, mesh.stamp_s
        until_s = self._begun_s + _WITHIN_S
        others = {n.id for n in mesh.nodes if n.id in before.on and not n.on} - set(self._cast)
        self._tell_return(mesh)
        mesh = yield [attempt(speed(FAST))]
        mesh = yield from self._bring_home(mesh, set(self._cast), (), until_s - _LAST_FLIGHTS_S)
        if others:
            who = f"The {len(others)} others are" if len(others) > 1 else "The other drone is"
            self._story.add(f"{who} switched on again", mesh.stamp_s)
        everyone = {*before.on, *self._cast}
        mesh = yield from self._bring_home(mesh, everyone, before.connected, until_s)
        home = [n.id for n in mesh.nodes if n.on and not away(n, before.homes)]
        offs = [power(node, False) for node in home if node in before.off]
        mesh = yield [*map(attempt, offs), attempt(speed(before.real_time_factor))]
        until_s = mesh.stamp_s + _SHOWN_WITHIN_S
        while (left := before.differences(mesh)) and mesh.stamp_s < until_s:
            mesh = yield []
        self._tell_end(left, mesh)

    def _bring_home(
        self, mesh: MeshStatus, ids: Collection[int], connected: Collection[int], until_s: float
    ) -> Returning:
        """Switch these on, and send each home as soon as nobody needs it where it is.

        It is over when they are home and `connected` have a gateway.
        """
        homes = {node: at for node, at in self._before.homes.items() if node in ids}
        while mesh.stamp_s < until_s:
            nodes = [node for node in mesh.nodes if node.id in ids]
            gone = [n for n in nodes if away(n, homes) and not (n.crashed or n.why_not_fly)]
            dark = [node.id for node in nodes if not node.on]
            if not (gone or dark or any(n.id in connected and not n.connected for n in nodes)):
                break
            orders = [power(node, True) for node in dark if self._is_due("power", node, mesh)]
            may_go = [n for n in gone if n.connected and not len(n.path)]
            if mesh.stamp_s < self._begun_s + _HOLD_S:
                needed = {relay for node in gone for relay in list(node.route)[1:-1]}
                all_hear = all(node.connected or len(node.path) for node in gone)
                may_go = [n for n in may_go if n.id not in needed] if all_hear else []
            for node in may_go:
                if self._is_due("fly", node.id, mesh):
                    orders.append(fly(node.id, homes[node.id]))
            mesh = yield [attempt(order) for order in orders]
        return mesh

    def _is_due(self, what: str, node: int, mesh: MeshStatus) -> bool:
        if mesh.stamp_s < self._due_s.get((what, node), -math.inf):
            return False
        self._due_s[what, node] = mesh.stamp_s + ORDER_AGAIN_S
        return True

    def _tell_return(self, mesh: MeshStatus) -> None:
        cast = [node for node in mesh.nodes if node.id in self._cast]
        dark = [node.id for node in cast if not node.on]
        gone = [node.id for node in cast if away(node, self._before.homes)]
        words = []
        if dark:
            words.append(f"{and_(dark)} {'is' if len(dark) == 1 else 'are'} switched on again")
        if len(gone) == 1:
            words.append(f"{gone[0]} returns to where it was")
        elif gone:
            rule = "Nobody leaves while another one needs it as a relay"
            words.append(f"{and_(gone)} return to where they were. {rule}")
        if words:
            self._story.add(", and ".join(words), mesh.stamp_s)

    def _tell_end(self, left: Sequence[str], mesh: MeshStatus) -> None:
        if not left:
            self._story.add("Everything is put back: power, places and speed", mesh.stamp_s)
            return
        more = f"; and {len(left) - _NAMED} more" if len(left) > _NAMED else ""
        self._story.add(
            f"Not everything is put back after {mesh.stamp_s - self._begun_s:.0f} s: "
            f"{'; '.join(left[:_NAMED])}{more}",
            mesh.stamp_s,
        )


def away(node: NodeStatus, places: Places) -> bool:
    """Whether this node has a place, and is not there or in flight."""
    return node.id in places and (len(node.path) > 0 or _from_home_m(node, places) > _AT_PLACE_M)


def rounded(place: Sequence[float]) -> Place:
    """The place as an order transmits it, with the height in whole metres."""
    x, y, z = place
    return round(x, 2), round(y, 2), max(0.0, float(round(z)))


def power(node_id: int, on: bool) -> Order:
    """Switch a node."""
    return lambda controls: controls.power(node_id, on)


def fly(node_id: int, place: Place) -> Order:
    """Send a drone to a place, which another one may be about to leave."""
    return lambda controls: controls.fly(node_id, *place, allow_shared_place=True)


def speed(factor: float) -> Order:
    """Let simulated time pass so many times as fast."""
    return lambda controls: controls.speed(False, factor)


def attempt(order: Order) -> Order:
    """Carry out an order and ignore its refusal: it is repeated later, or cannot be helped."""

    def carry_out(controls: MeshControls) -> None:
        with contextlib.suppress(OrderRefused):
            order(controls)

    return carry_out


def _from_home_m(node: NodeStatus, places: Places) -> float:
    return math.dist(node.position[:2], places[node.id][:2])
