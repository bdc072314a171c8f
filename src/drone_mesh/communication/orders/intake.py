"""OrderIntake: which orders a node accepts, and its replies to them.

docs/protocol.md, "Orders".
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Callable

from drone_mesh.communication.control.parts import NodeParts
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.orders.messages import OrderOutcome, OrderQuery, reply_packets
from drone_mesh.communication.timing.deadlines import Due
from drone_mesh.communication.wire.messages import GoToLocationMessage, order_number
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

ORDERS_KEPT = 8  # more than the gateways that order one drone
ARRIVED_WITHIN_M = 1.5  # a MAVLink drone has arrived within 1 m (drone/route.py)
REPLY_AGAIN_S = 1.0  # how often a reply without a route is retried
REPLY_TRIES = 120  # then the gateway queries

OwnReply = Callable[[int, OrderOutcome, str], None]
"""Receives replies of the gateway's own drone: order number, outcome, reason."""


@dataclass
class _KnownOrder:
    gateway: int
    number: int
    goal: Location
    outcome: OrderOutcome
    reason: str = ""
    tries_left: int = 0  # to send the latest outcome


class OrderIntake:
    """Checks the orders for one drone, starts its flights, and replies to numbered orders."""

    def __init__(self, parts: NodeParts, took_off: Callable[[], None]) -> None:
        """`took_off` is called when an order has started a flight."""
        self._parts = parts
        self._took_off = took_off
        self._known: deque[_KnownOrder] = deque(maxlen=ORDERS_KEPT)
        self.on_own_reply: OwnReply = _ignore

    def receive_move_to_location(self, payload: bytes, creator: int, _from: int) -> None:
        """An order from the air: accepted, or refused with a log line."""
        order = GoToLocationMessage.from_payload(payload)
        try:
            self.take(creator, order.location, order_number(payload))
        except GoalRefused as error:
            self._parts.complaints.add("order refused", str(error), self._parts.now_s)

    def take(self, gateway: int, goal: Location, number: int = 0) -> None:
        """Fly to `goal`, unless the drone already does: two gateways may order the same flight.

        A repeated order (same gateway, number and goal) only gets another reply. Raises GoalRefused
        if the drone does not fly there.
        """
        known = self._find(gateway, number)
        if known is not None and known.goal == goal:
            self._reply(known, known.outcome, known.reason)
            return
        order = _KnownOrder(gateway, number, goal, OrderOutcome.ACCEPTED)
        if number:
            self._remember(order)
        try:
            starts = self._obey(goal)
        except GoalRefused as error:
            self._reply(order, OrderOutcome.REFUSED, str(error))
            raise
        for other in self._under_way():
            if other.goal != goal:
                self._reply(other, OrderOutcome.REPLACED, _by(order, other.gateway))
        self._reply(order, OrderOutcome.ACCEPTED)
        if starts:
            self._parts.report(MeshEventKind.FLIGHT_ORDERED, gateway, order=number, place=goal)
            self._took_off()

    def on_foreign_order(self, order: GoToLocationMessage, number: int, passed_by: int) -> None:
        """An order from a neighbour whose places may refer to another frame: not flown."""
        foreign = _KnownOrder(order.creator, number, order.location, OrderOutcome.REFUSED)
        reason = f"node {passed_by}, which passed the order on, has another --origin"
        if number and self._find(order.creator, number) is None:
            self._remember(foreign)
        self._reply(foreign, OrderOutcome.REFUSED, reason)

    def on_foreign_passage(self, order: GoToLocationMessage, number: int, passed_by: int) -> None:
        """An order for another drone, dropped here for the same reason: tell its gateway."""
        if number:
            reason = f"node {passed_by} has another --origin"
            me, gateway = self._parts.node_id, order.creator
            for packet in reply_packets(number, OrderOutcome.REFUSED, reason, me, gateway):
                self._parts.delivery.send_own(packet)

    def receive_order_query(self, payload: bytes, gateway: int, _from: int) -> None:
        """A gateway queries the state of an order."""
        number = OrderQuery.number_in(payload)
        known = self._find(gateway, number)
        if known is not None:
            self._reply(known, known.outcome, known.reason)
        else:
            unknown = _KnownOrder(gateway, number, _NOWHERE, OrderOutcome.UNKNOWN)
            self._send(unknown)

    def on_landed(self) -> None:
        """Reply to the order whose flight is over, if there was one."""
        orders = self._under_way()
        if not orders:
            return
        pilot, engine = self._parts.pilot, self._parts.engine
        here = pilot.location()
        why = engine.why_ended() or engine.why_not_fly() or pilot.flight_end
        for order in orders:
            if here is None:
                self._reply(order, OrderOutcome.GIVEN_UP, f"{why}; its place is not known")
                continue
            off_m = here.distance_m(order.goal)
            if off_m <= ARRIVED_WITHIN_M:
                self._reply(order, OrderOutcome.ARRIVED)
            else:
                self._reply(order, OrderOutcome.GIVEN_UP, f"{why}; {off_m:.1f} m from the goal")

    def on_due(self) -> None:
        """Send the replies that had no route before."""
        self._parts.deadlines.set(Due.ORDER_REPLIES, math.inf)
        for order in self._known:
            if order.tries_left:
                self._send(order)

    def _obey(self, goal: Location) -> bool:
        """Start the flight; returns False if the drone already flies there."""
        check_goal(*goal)
        pilot = self._parts.pilot
        why_not = self._parts.engine.why_not_fly()
        if why_not:
            raise GoalRefused(f"drone {self._parts.node_id} cannot fly: {why_not}")
        if pilot.goal == goal:
            return False
        pilot.obey(goal)
        return True

    def _find(self, gateway: int, number: int) -> _KnownOrder | None:
        for order in self._known:
            if number and (order.gateway, order.number) == (gateway, number):
                return order
        return None

    def _remember(self, order: _KnownOrder) -> None:
        known = self._find(order.gateway, order.number)
        if known is not None:  # the gateway was restarted and reuses numbers
            self._known.remove(known)
        self._known.append(order)

    def _under_way(self) -> list[_KnownOrder]:
        return [order for order in self._known if order.outcome is OrderOutcome.ACCEPTED]

    def _reply(self, order: _KnownOrder, outcome: OrderOutcome, reason: str = "") -> None:
        order.outcome, order.reason = outcome, reason
        if order.gateway == self._parts.node_id:
            self.on_own_reply(order.number, outcome, reason)
        elif order.number:
            order.tries_left = REPLY_TRIES
            self._send(order)

    def _send(self, order: _KnownOrder) -> None:
        """Send the reply towards its gateway; right after a landing there is no route yet."""
        parts = self._parts
        packets = reply_packets(
            order.number, order.outcome, order.reason, parts.node_id, order.gateway
        )
        has_route = parts.routing.may_reach(order.gateway)
        if has_route and all([parts.delivery.send_own(packet) for packet in packets]):
            order.tries_left = 0
        elif order.tries_left:
            order.tries_left -= 1
            parts.deadlines.set(
                Due.ORDER_REPLIES, parts.now_s + parts.antenna.medium.stretched(REPLY_AGAIN_S)
            )


def _by(order: _KnownOrder, gateway: int) -> str:
    """The order that came, in words for this gateway."""
    if not order.number:
        return "by an order without a number"
    where = "" if order.gateway == gateway else f" of gateway {order.gateway}"
    return f"by order {order.number}{where}"


_NOWHERE = Location(math.nan, math.nan, math.nan)


def _ignore(_number: int, _outcome: OrderOutcome, _reason: str) -> None:
    """A router's own drone gets no orders from itself."""
