"""StandingOrders: formations as goals, kept until each drone is at its place.

docs/ros.md, "Drone manager". An order through the mesh is lost on a drone that has no route at
that moment, and a drone in flight has none: what has not been accepted is ordered again.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping, Sequence

from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.orders import CLOCKS_DIFFER_S

AT_PLACE_M = 0.5  # our choice: heights are rounded to whole metres, and physics moves drones
FIRST_PAUSE_S = 5.0  # our choice, simulated: an order over 100 nodes takes less than a second
LONGEST_PAUSE_S = 40.0  # our choice: each try costs a packet per hop


class PartState(enum.Enum):
    """How far one drone of a standing order has come."""

    WAITING = "without a route"
    FLYING = "flying"
    ARRIVED = "at its place"
    REFUSED = "refused"
    ABSENT = "not in this fleet"
    REPLACED = "replaced by a later order"

    @property
    def is_open(self) -> bool:
        """Whether the drone may still reach its place because of this order."""
        return self in (PartState.WAITING, PartState.FLYING, PartState.REFUSED)


@dataclass
class _Part:
    """The goal of one drone."""

    goal: Location
    state: PartState = PartState.WAITING
    reason: str = ""  # of a refusal
    pause_s: float = FIRST_PAUSE_S
    due_s: float = -math.inf  # when to order it next


@dataclass(frozen=True)
class StandingProgress:
    """How far one standing order has come: ids, ascending, by state."""

    number: int
    case: int
    drones: Mapping[PartState, Sequence[int]]
    reasons: Mapping[int, str] = field(default_factory=dict)  # of the refused drones

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to order."""
        return not any(self.drones[state] for state in PartState if state.is_open)

    def in_words(self) -> str:
        """One line, such as: 12 of 17 at their places, 3 flying, 2 without a route: 4, 9."""
        total = sum(len(drones) for drones in self.drones.values())
        noun = "place" if total == 1 else "places"
        words = [f"{len(self.drones[PartState.ARRIVED])} of {total} at their {noun}"]
        flying = self.drones[PartState.FLYING]
        if flying:
            words.append(f"{len(flying)} flying")
        for state in (PartState.WAITING, PartState.ABSENT, PartState.REPLACED):
            if self.drones[state]:
                ids = ids_in_words(self.drones[state])
                words.append(f"{len(self.drones[state])} {state.value}: {ids}")
        for drone in self.drones[PartState.REFUSED]:
            words.append(f"{drone} refused: {self.reasons[drone]}")
        return ", ".join(words)


class _StandingOrder:
    """One layout that was ordered."""

    def __init__(
        self, number: int, case: int, goals: Mapping[int, Location], given_s: float, due_s: float
    ) -> None:
        self.number = number
        self.case = case
        self.given_s = given_s
        self.parts = {drone: _Part(goal, due_s=due_s) for drone, goal in goals.items()}

    def progress(self) -> StandingProgress:
        """A snapshot."""
        by_state = {
            state: tuple(sorted(d for d, part in self.parts.items() if part.state is state))
            for state in PartState
        }
        reasons = {drone: self.parts[drone].reason for drone in by_state[PartState.REFUSED]}
        return StandingProgress(self.number, self.case, by_state, reasons)


class StandingOrders:
    """All layouts that were ordered and are not complete. Not thread-safe.

    Each drone has at most one goal: that of the latest order for it.
    """

    def __init__(self) -> None:
        self._orders: dict[int, _StandingOrder] = {}  # by number, oldest first
        self._last_number = 0

    def give(self, case: int, goals: Mapping[int, Location], now_s: float) -> int:
        """A layout is being ordered; returns its number. It replaces earlier goals of its drones.

        `now_s`: simulated time; the caller gives the first orders at that moment.
        """
        self.replace(goals)
        self._last_number += 1
        self._orders[self._last_number] = _StandingOrder(
            self._last_number, case, goals, now_s, now_s + FIRST_PAUSE_S
        )
        return self._last_number

    def replace(self, drones: Iterable[int]) -> None:
        """Another order for these drones followed."""
        for order in self._orders.values():
            for drone in drones:
                if drone in order.parts and order.parts[drone].state.is_open:
                    order.parts[drone].state = PartState.REPLACED

    def withdraw(self, number: int) -> StandingProgress | None:
        """Order no drone of this layout any more; returns how far it came. None: unknown."""
        order = self._orders.pop(number, None)
        return None if order is None else order.progress()

    def take(self, event: EventRecord) -> None:
        """Process an event: a drone refused its order, or somebody else sent it elsewhere."""
        if len(event.peers) != 1:
            return
        drone = event.peers[0]
        what, _, words = event.detail.partition(": ")
        for order in self._orders.values():
            part = order.parts.get(drone)
            is_older = event.stamp_s < order.given_s - CLOCKS_DIFFER_S
            if part is None or not part.state.is_open or is_older:
                continue
            if event.kind == MeshEventKind.ORDER_REFUSED.value:
                part.state, part.reason = PartState.REFUSED, words
            elif event.kind == MeshEventKind.ORDER_SENT.value and not what.endswith(_to(part.goal)):
                part.state = PartState.REPLACED

    def update(self, mesh: MeshStatus) -> list[tuple[int, Location]]:
        """Compare the goals with the state of the mesh; returns the orders to give now."""
        nodes = {node.id: node for node in mesh.nodes}
        wanted: list[tuple[int, Location]] = []
        for order in self._orders.values():
            for drone, part in order.parts.items():
                if part.state.is_open and self._follow(part, nodes.get(drone), mesh.stamp_s):
                    wanted.append((drone, part.goal))
        return wanted

    def _follow(self, part: _Part, node: NodeStatus | None, now_s: float) -> bool:
        """Update one drone's state; returns whether to order it now."""
        if node is None:
            part.state = PartState.ABSENT
            return False
        goal = _as_ordered(part.goal)
        if len(node.path):
            if Location.from_vector(node.path[-3:]).distance_m(goal) <= AT_PLACE_M:
                part.state, part.pause_s = PartState.FLYING, FIRST_PAUSE_S
                return False
        elif (
            position_is_known(node)
            and Location.from_vector(node.position).distance_m(goal) <= AT_PLACE_M
        ):
            part.state = PartState.ARRIVED
            return False
        if part.state is PartState.FLYING:
            part.state = PartState.WAITING
        if now_s < part.due_s or not (node.connected or node.role == Role.GATEWAY):
            return False
        part.due_s = now_s + part.pause_s
        part.pause_s = min(2.0 * part.pause_s, LONGEST_PAUSE_S)
        return True

    def all_progress(self) -> list[StandingProgress]:
        """How far each has come, oldest first."""
        return [order.progress() for order in self._orders.values()]

    def forget_complete(self) -> None:
        """Forget those with which nothing is left to do."""
        over = [number for number, order in self._orders.items() if order.progress().is_over]
        for number in over:
            del self._orders[number]

    # For a restart ---------------------------------------------------------------------------

    def saved(self) -> list[dict[str, Any]]:
        """What is left to do, in plain values."""
        return [
            {
                "number": order.number,
                "case": order.case,
                "goals": {
                    str(drone): list(part.goal)
                    for drone, part in order.parts.items()
                    if part.state.is_open
                },
            }
            for order in self._orders.values()
        ]

    def restore(self, saved: Iterable[Mapping[str, Any]]) -> None:
        """Go on with what `saved` returned."""
        for entry in saved:
            goals = {int(drone): Location(*goal) for drone, goal in entry["goals"].items()}
            number = int(entry["number"])
            self._orders[number] = _StandingOrder(
                number, int(entry["case"]), goals, -math.inf, -math.inf
            )
            self._last_number = max(self._last_number, number)


def _to(goal: Location) -> str:
    """How a gateway names an order to this place."""
    return f" to {_as_ordered(goal).in_words()}"


def _as_ordered(goal: Location) -> Location:
    """Orders carry whole metres of height."""
    return goal._replace(height=float(round(goal.height)))
