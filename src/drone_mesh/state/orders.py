"""How far the latest order of each drone has come, from the events of the gateways."""

from __future__ import annotations

from typing import Iterable

from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.order_record import OrderState
from drone_mesh.state.model import EventRecord

_STATE_OF = {
    MeshEventKind.ORDER_SENT.value: OrderState.ASKED,
    MeshEventKind.ORDER_ACCEPTED.value: OrderState.UNDER_WAY,
    MeshEventKind.ORDER_REFUSED.value: OrderState.REFUSED,
    MeshEventKind.ORDER_ARRIVED.value: OrderState.ARRIVED,
    MeshEventKind.ORDER_GIVEN_UP.value: OrderState.GIVEN_UP,
    MeshEventKind.NO_ROUTE.value: OrderState.NO_ROUTE,
}


class OrderWatch:
    """Follows events, and says for each drone how far its latest order has come, in words."""

    def __init__(self) -> None:
        self._latest: dict[int, tuple[int, str, str]] = {}  # drone -> gateway, order, words

    def take(self, events: Iterable[EventRecord]) -> None:
        """Take over new events, oldest first. An older order that ends changes nothing."""
        for event in events:
            state = _STATE_OF.get(event.kind)
            order, _, reason = event.detail.partition(": ")
            if state is None or len(event.peers) != 1 or not order:
                continue
            drone = event.peers[0]
            gateway, latest, _ = self._latest.get(drone, (event.node, order, ""))
            if gateway == event.node:
                counts = order == latest or state in (OrderState.ASKED, OrderState.NO_ROUTE)
            else:  # another gateway may well have no route
                counts = state is not OrderState.NO_ROUTE
            if counts:
                words = f"{state.value}: {reason}" if reason else state.value
                self._latest[drone] = event.node, order, words

    def words(self, drone: int) -> str:
        """Of its latest order; empty if there was none."""
        return self._latest[drone][2] if drone in self._latest else ""

    def forget(self) -> None:
        """A new run has begun."""
        self._latest.clear()
