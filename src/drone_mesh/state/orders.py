"""The progress of each drone's latest order, derived from the events of the gateways."""

from __future__ import annotations

import itertools
from typing import Iterable

from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.order_record import OrderState
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord

_STATE_OF = {
    MeshEventKind.ORDER_SENT.value: OrderState.ASKED,
    MeshEventKind.ORDER_ACCEPTED.value: OrderState.UNDER_WAY,
    MeshEventKind.ORDER_REFUSED.value: OrderState.REFUSED,
    MeshEventKind.ORDER_ARRIVED.value: OrderState.ARRIVED,
    MeshEventKind.ORDER_GIVEN_UP.value: OrderState.GIVEN_UP,
    MeshEventKind.NO_ROUTE.value: OrderState.NO_ROUTE,
}

CLOCKS_DIFFER_S = 0.1  # simulated; our choice: between the process that orders and a gateway's
BEING_SENT = "being sent"  # no gateway has reported the order yet


class OrderProgress:
    """Follows one order until it ends, through all gateways that sent it."""

    def __init__(self, drone: int, goal: Location, since_s: float) -> None:
        """Ignores events before `since_s` (simulated seconds), which belong to earlier orders."""
        self._drone = drone
        self._sent = f"to {goal.in_words()}"
        self._since_s = since_s
        self._orders: dict[tuple[int, str], OrderState] = {}  # by gateway and its order
        self.state = OrderState.ASKED
        self.reason = ""  # of the state

    @property
    def was_sent(self) -> bool:
        """Whether a gateway has reported that it sent the order."""
        return bool(self._orders)

    @property
    def is_over(self) -> bool:
        """Whether the drone has arrived, or no gateway's order is open any more."""
        return not self.state.is_open

    def take(self, event: EventRecord) -> None:
        """Process a new event; events of other orders are ignored."""
        state = _STATE_OF.get(event.kind)
        if state is None or tuple(event.peers) != (self._drone,) or self.is_over:
            return
        order, _, words = event.detail.partition(": ")
        key = event.node, order
        if state is OrderState.ASKED and words == self._sent and event.stamp_s >= self._since_s:
            self._orders.setdefault(key, state)
        elif key in self._orders:
            self._orders[key] = state
            self._conclude(state, words)

    def _conclude(self, state: OrderState, reason: str) -> None:
        """Update the outcome; `state` is that of the order that changed last."""
        ended = not any(other.is_open for other in self._orders.values())
        if state.is_open or state is OrderState.ARRIVED or ended:
            self.state, self.reason = state, reason


class OrderWatch:
    """Follows events and describes the progress of each drone's latest order."""

    def __init__(self) -> None:
        self._latest: dict[int, tuple[int, str, str]] = {}  # drone -> gateway, order, words
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
        """No event of this order is expected any more: it was refused, or no event came."""
        self._expected = {
            drone: other for drone, other in self._expected.items() if other != ticket
        }

    def take(self, events: Iterable[EventRecord]) -> None:
        """Process new events, oldest first. The end of an older order changes nothing."""
        for event in events:
            state = _STATE_OF.get(event.kind)
            order, _, reason = event.detail.partition(": ")
            if state is None or len(event.peers) != 1 or not order:
                continue
            drone = event.peers[0]
            gateway, latest, _ = self._latest.get(drone, (event.node, order, ""))
            if gateway == event.node:
                counts = order == latest or state in (OrderState.ASKED, OrderState.NO_ROUTE)
            else:  # another gateway may have no route
                counts = state is not OrderState.NO_ROUTE
            if state in (OrderState.ASKED, OrderState.NO_ROUTE):
                self._expected.pop(drone, None)
            if counts:
                words = f"{state.value}: {reason}" if reason else state.value
                self._latest[drone] = event.node, order, words

    def words(self, drone: int) -> str:
        """The progress of its latest order, as text; empty if there was none."""
        if drone in self._expected:
            return BEING_SENT
        return self._latest[drone][2] if drone in self._latest else ""

    def forget(self) -> None:
        """Forget all orders: a new run has begun."""
        self._latest.clear()
        self._expected.clear()
