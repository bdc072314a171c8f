"""OrderIntake: which orders a node accepts, and its replies to them.

docs/protocol.md, "Orders".
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import MeshEventKind, Reporter
from drone_mesh.communication.orders.book import OrderBook
from drone_mesh.communication.orders.messages import OrderOutcome, OrderQuery, reply_packets
from drone_mesh.communication.timing import Deadlines, Due, Medium
from drone_mesh.communication.wire.messages import GoToLocationMessage, order_number
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

ORDERS_KEPT = 8  # more than the gateways that order one drone
ARRIVED_WITHIN_M = 1.5  # a MAVLink drone has arrived within 1 m (drone/route.py)
REPLY_AGAIN_S = 1.0  # how often a reply without a route is retried
REPLY_TRIES = 120  # then the gateway queries


class ITakesOff(Protocol):
    """Who must know of flights."""

    def took_off(self) -> None:
        """The drone leaves its place because of an order."""


@dataclass
class _KnownOrder:
    gateway: int
    number: int
    goal: Location
    outcome: OrderOutcome
    reason: str = ""
    tries_left: int = 0  # to send the latest outcome


@dataclass(eq=False)
class OrderIntake:
    """Checks the orders for one drone, starts its flights, and replies to numbered orders."""

    _node_id: int
    _control: IControlPlane
    _pilot: Pilot
    _engine: IDroneEngine
    _deadlines: Deadlines
    _medium: Medium
    _complaints: Complaints
    _report: Reporter

    def __post_init__(self) -> None:
        self.flights: ITakesOff  # set by the node, like the book
        self.book: OrderBook | None = None  # a gateway's: its own drone replies to it
        self._known: deque[_KnownOrder] = deque(maxlen=ORDERS_KEPT)

    @receives(MessageType.MOVE_TO_LOCATION)
    def on_order(self, payload: bytes, creator: int, _from: int) -> None:
        """An order from the air: accepted, or refused with a log line."""
        order = GoToLocationMessage.from_payload(payload)
        try:
            self.take(creator, order.location, order_number(payload))
        except GoalRefused as error:
            self._complaints.add("order refused", str(error), self._deadlines.now_s)

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
            self._report(MeshEventKind.FLIGHT_ORDERED, gateway, order=number, place=goal)
            self.flights.took_off()

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
            me, gateway = self._node_id, order.creator
            for packet in reply_packets(number, OrderOutcome.REFUSED, reason, me, gateway):
                self._control.delivery.send_own(packet)

    @receives(MessageType.ORDER_QUERY)
    def on_query(self, payload: bytes, gateway: int, _from: int) -> None:
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
        pilot, engine = self._pilot, self._engine
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

    @due(Due.ORDER_REPLIES)
    def on_due(self) -> None:
        """Send the replies that had no route before."""
        self._deadlines.set(Due.ORDER_REPLIES, math.inf)
        for order in self._known:
            if order.tries_left:
                self._send(order)

    def _obey(self, goal: Location) -> bool:
        """Start the flight; returns False if the drone already flies there."""
        check_goal(*goal)
        why_not = self._engine.why_not_fly()
        if why_not:
            raise GoalRefused(f"drone {self._node_id} cannot fly: {why_not}")
        if self._pilot.goal == goal:
            return False
        self._pilot.obey(goal)
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
        if order.gateway == self._node_id:
            if self.book is not None:
                self.book.on_outcome(order.number, outcome, reason)
        elif order.number:
            order.tries_left = REPLY_TRIES
            self._send(order)

    def _send(self, order: _KnownOrder) -> None:
        """Send the reply towards its gateway; right after a landing there is no route yet."""
        packets = reply_packets(
            order.number, order.outcome, order.reason, self._node_id, order.gateway
        )
        delivery, has_route = self._control.delivery, self._control.routes.may_reach(order.gateway)
        if has_route and all([delivery.send_own(packet) for packet in packets]):
            order.tries_left = 0
        elif order.tries_left:
            order.tries_left -= 1
            again_s = self._medium.stretched(REPLY_AGAIN_S)
            self._deadlines.set(Due.ORDER_REPLIES, self._deadlines.now_s + again_s)


def _by(order: _KnownOrder, gateway: int) -> str:
    """The order that came, in words for this gateway."""
    if not order.number:
        return "by an order without a number"
    where = "" if order.gateway == gateway else f" of gateway {order.gateway}"
    return f"by order {order.number}{where}"


_NOWHERE = Location(math.nan, math.nan, math.nan)
