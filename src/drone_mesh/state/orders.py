"""The progress of orders to drones, derived from the events of the gateways.

The gateways decide the state of an order (communication/orders/book.py). What they cannot know is
added here, from the state of the mesh: how far the drone still has to fly, and what it did since.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, Iterable

from drone_mesh.communication.events.observer import MeshEventKind, explanation
from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.orders.book import EVENT_OF
from drone_mesh.communication.orders.intake import ARRIVED_WITHIN_M
from drone_mesh.drone.flight_path import CLIMB_ENDS_AT, SPEED_M_S
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord, NodeStatus, position_is_known, waypoints

_STATE_OF = {kind.value: state for state, kind in EVENT_OF.items()}
_DEEDS = {  # of a drone, that explain why it is not where it was ordered to
    MeshEventKind.FLIGHT_DECIDED.value: "flew to repair the mesh",
    MeshEventKind.CRASHED.value: "crashed",
    MeshEventKind.BATTERY_EMPTY.value: "its battery was empty",
    MeshEventKind.POWER_OFF.value: "was switched off",
}

CLOCKS_DIFFER_S = 0.1  # simulated; between the process that orders and a gateway's
BEING_SENT = "being sent"  # no gateway has reported the order yet
_ACROSS_M_S = SPEED_M_S / (1.0 - 2.0 * CLIMB_ENDS_AT)  # over the ground
_UPRIGHT_M_S = SPEED_M_S / (2.0 * CLIMB_ENDS_AT)  # half of the distance in a tenth of the time


@dataclass
class FollowedOrder:
    """One order of one gateway."""

    gateway: int
    number: int
    goal: Location  # where the drone was ordered to
    state: OrderState
    reason: str = ""
    deeds: tuple[str, ...] = ()  # of its drone, since the state changed

    @property
    def name(self) -> str:
        """Such as: order 7 to x 1.00 m, y 2.00 m, z 3 m."""
        return explanation(self.number, self.goal)

    def in_words(self, node: NodeStatus | None) -> str:
        """The state, with the way that is left; `node`: its drone now, None: unknown."""
        if self.state is OrderState.ACCEPTED and node is not None:
            left = way_left(node, self.goal)
            if left is not None:
                return f"under way, {left[0]:.0f} m and {left[1]:.0f} s left"
        return self.state.in_words(self.reason)

    def since(self, node: NodeStatus) -> str:
        """What the drone did after the state changed, as text; empty if the state says it."""
        goal, parts = self.goal, list(self.deeds)
        if not position_is_known(node):
            return ", ".join(parts)
        if len(node.path):
            end = Location.from_vector(node.path[-3:])
            if end.distance_m(goal) > ARRIVED_WITHIN_M:
                parts.append(f"flies to {end.in_words()}")
            elif self.state is not OrderState.ACCEPTED:
                parts.append("flies there")
        elif self.state in (OrderState.ACCEPTED, OrderState.ARRIVED, OrderState.LOST_CONTACT):
            off_m = Location.from_vector(node.position).distance_m(goal)
            if off_m > ARRIVED_WITHIN_M:
                parts.append(f"is {off_m:.0f} m from there")
        return ", ".join(parts)


def _deed(event: EventRecord) -> str:
    """What its drone did, in words; a flight to no node's place is its last one, and says why."""
    is_last = event.kind == MeshEventKind.FLIGHT_DECIDED.value and not event.peers
    return event.detail if is_last else _DEEDS[event.kind]


def way_left(node: NodeStatus, goal: Location) -> tuple[float, float] | None:
    """Straight metres and about how many seconds a drone still flies to `goal`; None: it does not.

    The seconds are those of a flight of a simulated drone (drone/flight_path.py).
    """
    if not len(node.path) or not position_is_known(node):
        return None
    if Location.from_vector(node.path[-3:]).distance_m(goal) > ARRIVED_WITHIN_M:
        return None
    corners = [node.position, *waypoints(node.path)]
    seconds = sum(
        math.dist(one[:2], other[:2]) / _ACROSS_M_S + abs(other[2] - one[2]) / _UPRIGHT_M_S
        for one, other in zip(corners, corners[1:])
    )
    return Location.from_vector(node.position).distance_m(goal), seconds


class OrderProgress:
    """Follows one order until it ends, through all gateways that sent it."""

    def __init__(self, drone: int, goal: Location, since_s: float) -> None:
        """Ignores events before `since_s` (simulated seconds), which belong to earlier orders."""
        self._drone = drone
        self._goal = goal.as_ordered()
        self._since_s = since_s
        self._orders: dict[tuple[int, int], FollowedOrder] = {}  # by gateway and its number
        self._latest = FollowedOrder(0, 0, goal, OrderState.SENT)

    @property
    def state(self) -> OrderState:
        """The state of the order, by the reports of all gateways."""
        return self._latest.state

    @property
    def was_sent(self) -> bool:
        """Whether a gateway has reported that it sent the order."""
        return bool(self._orders)

    @property
    def is_over(self) -> bool:
        """Whether the drone has arrived, or no gateway's order is open any more."""
        return not self.state.is_open

    def in_words(self, node: NodeStatus | None = None) -> str:
        """The state in words, with the way that is left if `node` is its drone now."""
        return self._latest.in_words(node)

    def on_event(self, event: EventRecord) -> None:
        """Process a new event; events of other orders are ignored."""
        order = _order_in(event)
        if order is None or event.peers != (self._drone,) or self.is_over:
            return
        key = order.gateway, order.number
        is_sent = order.state is OrderState.SENT and order.goal.as_ordered() == self._goal
        if is_sent and event.stamp_s >= self._since_s:
            self._orders.setdefault(key, order)
        elif key in self._orders:
            self._orders[key] = order
            ended = not any(other.state.is_open for other in self._orders.values())
            if order.state.is_open or order.state is OrderState.ARRIVED or ended:
                self._latest = order


class OrderWatch:
    """Follows events and describes the progress of each drone's latest order."""

    def __init__(self) -> None:
        self._latest: dict[int, FollowedOrder] = {}  # by drone
        self._tickets = itertools.count()
        self._expected: dict[int, int] = {}  # drone -> ticket of an order without an event so far

    def expect(self, drones: Iterable[int]) -> int:
        """An order to these drones is being given; returns a ticket for `forget_expected`.

        Until its first event, the progress of an earlier order is not shown.
        """
        ticket = next(self._tickets)
        self._expected.update(dict.fromkeys(drones, ticket))
        return ticket

    def forget_expected(self, ticket: int) -> None:
        """Stop expecting events of this order, which was refused or had none in time."""
        self._expected = {
            drone: other for drone, other in self._expected.items() if other != ticket
        }

    def on_events(self, events: Iterable[EventRecord]) -> None:
        """Process new events, oldest first. The end of an older order changes nothing."""
        for event in events:
            if event.kind in _DEEDS and event.node in self._latest:
                latest = self._latest[event.node]
                latest.deeds = (*latest.deeds, _deed(event))[-2:]
            order = _order_in(event)
            if order is not None:
                self._follow(event.peers[0], order)

    def _follow(self, drone: int, order: FollowedOrder) -> None:
        latest = self._latest.get(drone, order)
        is_new = order.state in (OrderState.SENT, OrderState.NO_ROUTE)
        if latest.gateway == order.gateway:
            counts = order.number == latest.number or is_new
        else:  # another gateway may have no route
            counts = order.state is not OrderState.NO_ROUTE
        if is_new:
            self._expected.pop(drone, None)
        if counts:
            self._latest[drone] = order

    def words(self, drone: int, node: NodeStatus | None) -> str:
        """The latest order of a node and its progress, as text; empty if there was none."""
        if drone in self._expected:
            return BEING_SENT
        latest = self._latest.get(drone)
        return "" if latest is None else f"{latest.name}: {latest.in_words(node)}"

    def since(self, node: NodeStatus) -> str:
        """What the drone did after the state of its latest order changed; empty: nothing."""
        latest = None if node.id in self._expected else self._latest.get(node.id)
        return "" if latest is None else latest.since(node)

    def saved(self) -> list[list[Any]]:
        """The latest orders, as plain values that `restore` reads."""
        return [
            [drone, o.gateway, o.number, list(o.goal), o.state.name, o.reason, list(o.deeds)]
            for drone, o in self._latest.items()
        ]

    def restore(self, saved: Iterable[Iterable[Any]]) -> None:
        """Go on with what `saved` returned."""
        for drone, gateway, number, goal, state, reason, deeds in saved:
            place = Location(*map(float, goal))
            self._latest[int(drone)] = FollowedOrder(
                int(gateway), int(number), place, OrderState[state], str(reason), tuple(deeds)
            )

    def forget(self) -> None:
        """Forget all orders: a new run has begun."""
        self._latest.clear()
        self._expected.clear()


def _order_in(event: EventRecord) -> FollowedOrder | None:
    """The order that a gateway's event is about; None: it is about something else."""
    state = _STATE_OF.get(event.kind)
    if state is None or len(event.peers) != 1 or event.place is None:
        return None
    return FollowedOrder(event.node, event.order, event.place, state, event.detail)
