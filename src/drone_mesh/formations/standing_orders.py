"""StandingOrders: formations as goals, kept until each drone is at its place.

docs/ros.md, "Formations". An order through the mesh is lost on a drone that has no route at that
moment, and a drone in flight has none: what has not been accepted is ordered again. Departures
decides which drones set out when.
"""

from __future__ import annotations

import math
from contextlib import nullcontext
from typing import Any, ContextManager, Iterable, Mapping

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.departures import AT_PLACE_M, Departures, FlightRules
from drone_mesh.formations.standing_order import (
    FIRST_PAUSE_S,
    Part,
    PartState,
    StandingOrder,
    StandingProgress,
)
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.orders import CLOCKS_DIFFER_S

CUT_OFF = "its place is out of reach"  # it was there, and a repair brought it back
UNDER_WAY_S = 30.0  # a gateway repeats an order for as long: the drone may still set out


class StandingOrders:
    """All layouts that were ordered and are not complete.

    Each drone has at most one goal: that of the latest order for it. Whoever shares them between
    threads holds a lock for each call; what a Relief calls takes it itself.
    """

    def __init__(self, lock: ContextManager[object] | None = None) -> None:
        """`lock`: a reentrant one; None: they belong to one thread."""
        self._lock = lock or nullcontext()
        self._orders: dict[int, StandingOrder] = {}  # by number, oldest first
        self._sent: dict[int, tuple[Location, float]] = {}  # latest order of each drone, and when
        self._last_number = 0

    def give(
        self,
        name: str,
        goals: Mapping[int, Location],
        now_s: float,
        at_once: bool = False,
        relieves: int | None = None,
    ) -> int:
        """Begin an order to these drones, which replaces their earlier goals; returns its number.

        `name`: such as "layout 202"; `now_s`: simulated time. `at_once`: all drones set out
        together, whatever becomes of the mesh and whomever they meet. `relieves`: the drone whose
        place is taken; the order then lasts until `end`. The first orders are those of the next
        `update`.
        """
        parts = {drone: Part(goal, at_once) for drone, goal in goals.items()}
        with self._lock:
            self._replace(goals)
            number = self._last_number = self._last_number + 1
            self._orders[number] = StandingOrder(number, name, parts, now_s, at_once, relieves)
        return number

    def stands(self, number: int) -> bool:
        """Whether this order is known, and no later one has sent its drones elsewhere."""
        with self._lock:
            order = self._orders.get(number)
            parts = order.parts.values() if order else ()
            return bool(parts) and all(part.state is not PartState.REPLACED for part in parts)

    def is_bound(self, drone: int, at: Location, now_s: float) -> bool:
        """Whether an order may still move this drone, which stands there."""
        with self._lock:
            parts = [order.parts[drone] for order in self._orders.values() if drone in order.parts]
            return any(part.state.is_open for part in parts) or self._may_leave(drone, at, now_s)

    def ordered(self, drone: int, to: Location, now_s: float) -> None:
        """Somebody else ordered this drone to a place."""
        self._replace([drone])
        self._sent[drone] = to, now_s

    def _replace(self, drones: Iterable[int]) -> None:
        for order in self._orders.values():
            for drone in drones:
                if drone in order.parts and order.parts[drone].is_followed:
                    order.parts[drone].replace()

    def withdraw(self, number: int) -> StandingProgress | None:
        """Order no drone of this layout any more; returns its progress, None if it is unknown."""
        order = self._orders.pop(number, None)
        if order is None:
            return None
        progress = order.progress()
        for part in order.parts.values():
            part.replace()  # for an `update` that plans now
        return progress

    def end(self, number: int) -> None:
        """Like withdraw, but its last progress, which is over, is still shown to who watches it."""
        with self._lock:
            if number in self._orders:
                self._orders[number].relieves = None
                for part in self._orders[number].parts.values():
                    part.replace()

    def on_event(self, event: EventRecord) -> None:
        """Process an event: a drone refused its order, or somebody else sent it elsewhere."""
        if len(event.peers) != 1:
            return
        drone = event.peers[0]
        for order in self._orders.values():
            part = order.parts.get(drone)
            is_older = event.stamp_s < order.given_s - CLOCKS_DIFFER_S
            if part is None or not part.is_followed or is_older:
                continue
            if event.kind == MeshEventKind.ORDER_REFUSED.value:
                part.stay(PartState.REFUSED, event.detail)
            elif event.kind == MeshEventKind.NO_ROUTE.value:
                if event.order:  # a relay without a route names none, and the gateway tries on
                    part.sent_to = None
            elif event.kind == MeshEventKind.ORDER_SENT.value and not part.is_ordered(event.place):
                part.replace()

    def update(
        self,
        mesh: MeshStatus,
        rules: FlightRules = FlightRules(),  # noqa: B008 (immutable)
    ) -> list[tuple[int, Location]]:
        """Compare the goals with the state of the mesh; returns the orders to give now.

        One thread at a time may call it: it plans without the lock, which others need meanwhile.
        """
        with self._lock:
            parts = self._to_order(mesh, rules)
            goals = self.goals(mesh)
            sent = {
                drone: part.sent_to.as_ordered()
                for order in self._orders.values()
                for drone, part in order.parts.items()
                if part.state.is_open and part.sent_to is not None
            }
            latest = self._orders[max(self._orders)].parts if self._orders else {}
            first = {drone for drone, part in latest.items() if part.is_followed}
        wanted = {drone: part.sent_to for drone, part in parts.items() if part.sent_to is not None}
        new = {drone: part for drone, part in parts.items() if drone not in wanted}
        refused: dict[int, str] = {}
        if new:
            departures = Departures(mesh, goals, sent, rules, first)
            taken = {n: departures.taken_by(n) for n, part in new.items() if part.at_once}
            wanted.update({n: new[n].goal for n, others in taken.items() if not others})
            back = {n for n, part in new.items() if part.arrived and not part.at_once}
            cut_off = {n: CUT_OFF for n in back if not departures.is_in_reach(n)}
            choice = departures.choose(new.keys() - taken.keys() - cut_off.keys())
            wanted.update(choice.set_out)
            refused = {**taken, **cut_off, **choice.blocked}
        with self._lock:
            parts = {drone: part for drone, part in parts.items() if part.is_followed}
            for drone, reason in refused.items():
                if reason and drone in parts:
                    parts[drone].stay(PartState.REFUSED, reason)
            wanted = {drone: to for drone, to in wanted.items() if drone in parts}
            for drone, to in wanted.items():
                if parts[drone].state is PartState.REFUSED:
                    parts[drone].state = PartState.LATER
                parts[drone].send(to, mesh.stamp_s)
                self._sent[drone] = to, mesh.stamp_s
        return list(wanted.items())

    def _to_order(self, mesh: MeshStatus, rules: FlightRules) -> dict[int, Part]:
        """The drones that must be ordered, or ordered again."""
        nodes = {node.id: node for node in mesh.nodes}
        found: dict[int, Part] = {}
        for order in self._orders.values():
            is_moving = order.is_moving()
            for drone, part in sorted(order.parts.items(), reverse=True):
                if not part.is_followed or (part.state is PartState.ARRIVED and not is_moving):
                    continue
                why_not = rules.fence.why_not(part.goal.to_vector()) if rules.fence else ""
                if why_not and part.state.is_open:  # until the fence changes again
                    part.stay(PartState.REFUSED, why_not)
                elif self._follow(part, nodes.get(drone), mesh.stamp_s):
                    found[drone] = part
        return found

    def goals(self, mesh: MeshStatus) -> dict[int, Location]:
        """The places that drones still have to reach, or have reached and keep."""
        at = {n.id: Location.from_vector(n.position) for n in mesh.nodes if position_is_known(n)}
        goals: dict[int, Location] = {}
        for order in self._orders.values():
            for drone, part in order.parts.items():
                goal = part.goal.as_ordered()
                stands = drone in at and at[drone].distance_m(goal) <= AT_PLACE_M
                if part.state.is_open or (part.state is PartState.ARRIVED and stands):
                    goals[drone] = goal
        return goals

    def _follow(self, part: Part, node: NodeStatus | None, now_s: float) -> bool:
        """Update one drone's state; returns whether it may be ordered now."""
        if node is None:
            part.state = PartState.ABSENT
            return False
        flies = bool(len(node.path))
        has_route = node.connected or node.role == Role.GATEWAY
        if flies or position_is_known(node):
            end = Location.from_vector(node.path[-3:] if flies else node.position)
            is_there = end.distance_m(part.goal.as_ordered()) <= AT_PLACE_M
            if is_there and not flies and self._may_leave(node.id, part.goal, now_s):
                part.stay(PartState.LATER if has_route else PartState.WAITING)
                part.sent_to = part.goal if has_route else None  # replaces the order that it has
                return has_route
            if is_there:
                part.stay(PartState.FLYING if flies else PartState.ARRIVED)
                part.pause_s = FIRST_PAUSE_S
                part.arrived = part.arrived or not flies
                part.settled = not flies and has_route
                return False
            is_aside = part.sent_to is not None and end.distance_m(part.sent_to) <= AT_PLACE_M
            if is_aside and not flies:
                part.sent_to, part.due_s = None, now_s
        if now_s - part.sent_s >= UNDER_WAY_S and not flies:
            part.sent_to = None
        if part.state is not PartState.REFUSED:
            part.state = PartState.LATER if has_route or flies else PartState.WAITING
        if part.at_once and part.sent_s == -math.inf:
            return True  # a gateway may find a drone that seems lost
        return now_s >= part.due_s and has_route and (part.at_once or not flies)

    def _may_leave(self, drone: int, goal: Location, now_s: float) -> bool:
        """Whether it may still follow an order to another place."""
        to, sent_s = self._sent.get(drone, (goal, -math.inf))
        return to.distance_m(goal) > AT_PLACE_M and now_s - sent_s < UNDER_WAY_S

    def all_progress(self) -> list[StandingProgress]:
        """How far each has come, oldest first."""
        return [order.progress() for order in self._orders.values()]

    def forget_complete(self) -> None:
        """Forget the orders that are complete."""
        over = [number for number, order in self._orders.items() if order.progress().is_over]
        for number in over:
            del self._orders[number]

    # For a restart ---------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        """The orders that are left, as plain values that `restore` reads."""
        orders = [
            {
                "number": order.number,
                "name": order.name,
                "at_once": order.at_once,
                "relieves": order.relieves,
                "goals": {
                    str(drone): list(part.goal)
                    for drone, part in order.parts.items()
                    if part.state.is_open
                    or (part.state is PartState.ARRIVED and order.relieves is not None)
                },
            }
            for order in self._orders.values()
        ]
        return {"last_number": self._last_number, "orders": orders}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with what `saved` returned."""
        self._last_number = int(saved["last_number"])
        for entry in saved["orders"]:
            number, name = int(entry["number"]), str(entry["name"])
            goals, at_once = entry["goals"].items(), bool(entry["at_once"])
            parts = {int(n): Part(Location(*goal), at_once) for n, goal in goals}
            order = StandingOrder(number, name, parts, -math.inf, at_once, entry["relieves"])
            self._orders[number] = order
