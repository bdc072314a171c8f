"""OrderBook: the outcome of the orders that a gateway sent.

docs/protocol.md, "Orders".
"""

from __future__ import annotations

import itertools
import math
import operator
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Callable, Iterable

from drone_mesh.communication.control.control_plane import NUMBERS_PER_S, IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import MeshEventKind, Reporter, explanation
from drone_mesh.communication.interfaces import OrderRecord, OrderState
from drone_mesh.communication.orders.intake import OrderOutcome, OrderQuery, OrderReply
from drone_mesh.communication.timing import Deadlines, Due, Medium
from drone_mesh.communication.wire.messages import GoToLocationMessage, with_order_number
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.communication.wire.text_parts import TextAssembly
from drone_mesh.drone.location import Location

OLD_ORDERS_KEPT = 100  # besides the latest of each drone
HIGHEST_NUMBER = 2**16 - 1
REPEAT_AFTER_S = (2.0, 4.0, 8.0, 16.0)  # pauses between tries without a reply
FOUND_WITHIN_S = 1.0  # a search passes through 100 nodes within half a second
MOST_WAITS = 4  # of an order without a route: its drone may be in flight, out of reach
MOST_SEARCHES = 3  # per order; the path that a search found may break at once
QUERY_PERIOD_S = 15.0  # period of queries to a drone under way
MOST_QUERIES = 20  # without an answer: five minutes


EVENT_OF = {
    OrderState.SENT: MeshEventKind.ORDER_SENT,
    OrderState.ACCEPTED: MeshEventKind.ORDER_ACCEPTED,
    OrderState.ARRIVED: MeshEventKind.ORDER_ARRIVED,
    OrderState.REPLACED: MeshEventKind.ORDER_REPLACED,
    OrderState.REFUSED: MeshEventKind.ORDER_REFUSED,
    OrderState.NO_ROUTE: MeshEventKind.NO_ROUTE,
    OrderState.LOST_CONTACT: MeshEventKind.ORDER_LOST_CONTACT,
    OrderState.GIVEN_UP: MeshEventKind.ORDER_GIVEN_UP,
}
_FAILURES = (
    OrderState.REFUSED, OrderState.NO_ROUTE, OrderState.LOST_CONTACT, OrderState.GIVEN_UP,
)  # fmt: skip


@dataclass
class _Order:
    number: int
    drone: int
    goal: Location
    ordered_s: float
    state: OrderState = OrderState.SENT
    reason: str = ""
    changed_s: float = 0.0
    due_s: float = math.inf  # next repeat or query
    searches: int = 0  # number of searches for the drone without a route
    seeking: bool = False  # a search for it is running or about to start
    copies: int = 0  # that left and that no relay said to have dropped: the drone may have one
    waits: int = 0  # for a route, instead of a try
    waiting: bool = False  # for a route: it is sent again as soon as its drone is heard
    unanswered: int = 0  # packets since the drone's last reply about it
    heard_s: float = 0.0  # when the drone last reported about it, or when it was ordered
    settled: bool = False  # the drone itself has reported the outcome
    dropped: str = ""  # why a relay says that it has dropped the order
    # Reasons in parts: True: of its drone, False: of relays
    parts: dict[bool, TextAssembly] = field(default_factory=lambda: defaultdict(TextAssembly))


@dataclass(eq=False)
class OrderBook:
    """The orders of one gateway. Only its component calls it."""

    _node_id: int
    _control: IControlPlane
    _deadlines: Deadlines
    _medium: Medium
    _complaints: Complaints
    _report_event: Reporter
    _may_find: Callable[[int], bool]  # whether a search could find a drone without a route

    def __post_init__(self) -> None:
        self._slowness = self._medium.stretched(1.0)
        self._orders: dict[int, _Order] = {}  # oldest first
        self._last_number = 0

    def records(self) -> list[OrderRecord]:
        """All remembered orders, oldest first."""
        told = operator.attrgetter(*OrderRecord._fields)
        return [OrderRecord(*told(order)) for order in self._orders.values()]

    def enter(self, drone: int, goal: Location) -> int:
        """Record a new order; returns its number."""
        now_s = self._deadlines.now_s
        number = self._next_number()
        self._orders[number] = _Order(number, drone, goal, now_s, changed_s=now_s, heard_s=now_s)
        self._forget_old()
        return number

    def send(self, number: int) -> bool:
        """Send an order for the first time, or search for its drone.

        False: there is no route and no search; it is not tried again.
        """
        order = self._orders[number]
        if self._send(order):
            self._wait(order, REPEAT_AFTER_S[0])
        elif not self._seek(order):
            self._move(order, OrderState.NO_ROUTE)
            return False
        # Not of one that the drone has accepted: it flies there until it has the new one.
        self._replace(order, [o for o in self._open_for(order.drone) if o.state is OrderState.SENT])
        self._report(order)
        return True

    def on_missing(self, drone: int, told: bool) -> None:
        """A relay has no route to this drone; `told`: it tells this gateway, and drops an order.

        One that tells all its neighbours has lost the drone, which may have left for this order.
        On a shared channel a relay also drops what arrived, if the acknowledgements were lost.
        """
        for order in self._open_for(drone):
            order.copies -= told and order.copies > 0 and self._medium.policy.drops_are_certain
            waits = order.state is not OrderState.SENT or order.seeking
            if not waits and not self._seek(order):
                self._move(order, OrderState.NO_ROUTE)

    def on_found(self, drone: int) -> None:
        """A drone was heard, along a working path."""
        for order in self._open_for(drone):
            if order.seeking or order.waiting:
                order.seeking = order.waiting = False
                self._send(order)
                self._wait(order, REPEAT_AFTER_S[order.unanswered])

    def _seek(self, order: _Order) -> bool:
        """Search for the drone. False: the order is lost.

        Not if the drone may have it: after the last search it is repeated, as without searches.
        """
        order.seeking = order.searches < MOST_SEARCHES and self._may_find(order.drone)
        if not order.seeking:
            order.waiting = order.copies > 0 and order.searches > 0
            if order.copies and order.due_s == math.inf:
                self._wait(order, REPEAT_AFTER_S[order.unanswered])
            return order.copies > 0
        if self._control.search(order.drone):
            order.searches += 1
            self._wait(order, FOUND_WITHIN_S)
        else:
            self._wait(order, self._medium.policy.search_pause_s)
        return True

    @receives(MessageType.ORDER_REPLY)
    def on_reply(self, payload: bytes, drone: int, _from: int) -> None:
        """A part of a drone's reply; acts when the last missing part has arrived."""
        reply = OrderReply.from_payload(payload)
        if reply is None:
            what, now_s = "an invalid reply to an order", self._deadlines.now_s
            self._complaints.dropped(what, payload, now_s)
            return
        order = self._orders.get(reply.number)
        if order is None:
            return
        reason = order.parts[drone == order.drone].add(reply.part, reply.text)
        if reason is None:
            return
        if drone == order.drone:
            self.on_outcome(reply.number, reply.outcome, reason)
        elif reply.outcome is OrderOutcome.REFUSED:  # a relay; its word alone decides nothing
            order.dropped = f"node {drone} dropped the order: {reason}"

    def on_outcome(self, number: int, outcome: OrderOutcome, reason: str) -> None:
        order = self._orders.get(number)
        if order is None or order.settled:
            return
        order.unanswered, order.heard_s = 0, self._deadlines.now_s
        is_unknown = outcome is OrderOutcome.UNKNOWN
        if is_unknown:
            reason = "the drone no longer knows this order"
        order.settled = outcome is not OrderOutcome.ACCEPTED
        if outcome in (OrderOutcome.ACCEPTED, OrderOutcome.ARRIVED):
            self._replace(order, self._older(order), for_good=True)
        state = OrderState.GIVEN_UP if is_unknown else OrderState[outcome.name]
        self._move(order, state, reason)
        is_own = order.drone == self._node_id
        self._wait(order, math.inf if order.settled or is_own else QUERY_PERIOD_S)

    @due(Due.ORDERS)
    def on_due(self) -> None:
        """Repeat orders without a reply, and query drones that are under way."""
        now_s = self._deadlines.now_s
        for order in list(self._orders.values()):
            if order.due_s <= now_s:
                self._pursue(order)
        self._schedule()

    def _pursue(self, order: _Order) -> None:
        order.due_s = math.inf
        if order.seeking:
            if not self._seek(order):
                self._move(order, OrderState.NO_ROUTE)
            return
        # Without one nothing is repeated: the drone may be in flight, out of reach.
        has_route = self._control.routes.may_reach(order.drone)
        order.waiting = order.state is OrderState.SENT and not has_route
        if order.waiting and order.waits < MOST_WAITS:
            order.waits += 1
            self._wait(order, REPEAT_AFTER_S[order.unanswered])
            return
        order.unanswered += 1
        if order.state is OrderState.SENT:
            if order.unanswered >= len(REPEAT_AFTER_S):
                self._lost(order, order.dropped or "it did not reply")
                return
            if has_route:
                self._send(order)
            self._wait(order, REPEAT_AFTER_S[order.unanswered])
        elif order.state is OrderState.ACCEPTED:
            if order.unanswered > MOST_QUERIES:
                self._lost(order, "it fell silent on its way")
                return
            query = OrderQuery.packet(order.number, self._node_id, order.drone)
            if has_route:
                self._control.delivery.send_own(query)
            self._wait(order, QUERY_PERIOD_S)

    def _send(self, order: _Order) -> bool:
        me, to = self._node_id, order.drone
        latitude, longitude, height = order.goal
        packet = GoToLocationMessage(me, me, to, to, latitude, longitude, int(height)).to_payload()
        taken = self._control.delivery.send_own(with_order_number(packet, order.number))
        order.copies += taken
        return taken

    def _lost(self, order: _Order, why: str) -> None:
        self._move(order, OrderState.LOST_CONTACT, f"at {order.heard_s:.0f} s: {why}")

    def _replace(self, order: _Order, older: Iterable[_Order], for_good: bool = False) -> None:
        """End these older orders for the same drone; `for_good`: ignore later reports on them."""
        for other in older:
            if other is not order:
                other.settled = for_good
                self._move(other, OrderState.REPLACED, f"by order {order.number}")

    def _older(self, order: _Order) -> list[_Order]:
        """The orders for its drone before it whose end the drone has not reported."""
        return [
            other
            for other in itertools.takewhile(lambda one: one is not order, self._orders.values())
            if other.drone == order.drone
            and not (other.settled or other.state is OrderState.NO_ROUTE)
        ]

    def _move(self, order: _Order, state: OrderState, reason: str = "") -> None:
        if state is order.state:
            return
        order.state, order.reason, order.changed_s = state, reason, self._deadlines.now_s
        order.due_s = math.inf
        order.seeking = order.waiting = False
        self._report(order)

    def _report(self, order: _Order) -> None:
        number, goal = order.number, order.goal
        if order.state in _FAILURES:
            words = explanation(number, goal, order.state.in_words(order.reason))
            is_unknown = order.state is OrderState.LOST_CONTACT  # it may have arrived
            what = "has an unknown outcome" if is_unknown else "failed"
            reason = f"an order for drone {order.drone} {what}"
            self._complaints.add(reason, words, self._deadlines.now_s)
        self._report_event(EVENT_OF[order.state], order.drone, order.reason, number, goal)

    def _wait(self, order: _Order, seconds: float) -> None:
        """Repeat or query after so many seconds, on a slow medium more."""
        order.due_s = self._deadlines.now_s + seconds * self._slowness
        self._schedule()

    def _schedule(self) -> None:
        due_s = min((order.due_s for order in self._orders.values()), default=math.inf)
        self._deadlines.set(Due.ORDERS, due_s)

    def _open_for(self, drone: int) -> list[_Order]:
        return [
            order for order in self._orders.values() if order.drone == drone and order.state.is_open
        ]

    def _forget_old(self) -> None:
        latest = {order.drone: order.number for order in self._orders.values()}
        old = [n for n, order in self._orders.items() if latest[order.drone] != n]
        for number in old[: max(0, len(old) - OLD_ORDERS_KEPT)]:
            del self._orders[number]

    def _next_number(self) -> int:
        if not self._last_number:
            self._last_number = int(self._deadlines.now_s * NUMBERS_PER_S) % HIGHEST_NUMBER
        self._last_number = self._last_number % HIGHEST_NUMBER + 1
        return self._last_number
