"""OrderIntake: which orders a node accepts, and its replies to them.

docs/protocol.md, "Orders". The bodies of both messages, types 64 and 65, fit into 14 bytes, so that
they leave room for a seal.
"""

from __future__ import annotations

import enum
import math
import struct
from collections import deque
from dataclasses import dataclass
from typing import Callable, ClassVar, Protocol

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import MeshEventKind, Reporter
from drone_mesh.communication.timing import Deadlines, Due, Medium
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import HEADER_BYTES, GoToLocationMessage, order_number
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.communication.wire.text_parts import is_valid, split
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

ORDERS_KEPT = 8  # more than the gateways that order one drone
ARRIVED_WITHIN_M = 1.5  # a MAVLink drone has arrived within 1 m (drone/route.py)
REPLY_AGAIN_S = 1.0  # how often a reply without a route is retried
LOOK_AGAIN_S = 0.05  # whether the neighbours know by now
REPLY_TRIES = 120  # then the gateway queries
TEXT_BYTES = 10  # of a reason, in one packet


class OrderOutcome(enum.IntEnum):
    """The outcome of an order, as reported by the drone."""

    ACCEPTED = 1  # it flies there
    REFUSED = 2  # it stays; with a reason
    ARRIVED = 3  # it is there
    GIVEN_UP = 4  # the flight ended elsewhere; with the reason
    UNKNOWN = 5  # answer to a query: it knows no such order (any more)
    REPLACED = 6  # it flies elsewhere; with the order that came


@dataclass(frozen=True)
class OrderReply:
    """One part of a drone's reply about the order `number` to the gateway that sent it."""

    TYPE: ClassVar[MessageType] = MessageType.ORDER_REPLY
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    number: int  # 1..65535
    outcome: OrderOutcome
    part: int  # see text_parts.split
    text: bytes  # of the reason, UTF-8, at most TEXT_BYTES

    @classmethod
    def from_payload(cls, payload: bytes) -> OrderReply | None:
        """Decode; None for an invalid outcome or part."""
        number, outcome, part, text = cls.BODY.unpack_from(payload, HEADER_BYTES)
        try:
            known = OrderOutcome(outcome)
        except ValueError:
            return None
        return cls(number, known, part, text) if is_valid(part) else None


def reply_packets(
    number: int, outcome: OrderOutcome, reason: str, creator: int, gateway: int
) -> list[bytes]:
    """The reply in as many packets as its reason needs, from `creator` for `gateway`."""
    pack, kind = OrderReply.BODY.pack, OrderReply.TYPE
    return [
        messages.packet(kind, creator, creator, gateway, gateway, pack(number, outcome, part, text))
        for part, text in split(reason, TEXT_BYTES)
    ]


class OrderQuery:
    """A gateway asks for the state of an order; the body is its number."""

    TYPE: ClassVar[MessageType] = MessageType.ORDER_QUERY
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    @classmethod
    def packet(cls, number: int, gateway: int, drone: int) -> bytes:
        return messages.packet(cls.TYPE, gateway, gateway, drone, drone, cls.BODY.pack(number))

    @classmethod
    def number_in(cls, payload: bytes) -> int:
        return int(cls.BODY.unpack_from(payload, HEADER_BYTES)[0])


class IDeparts(Protocol):
    """Who must know of ordered flights."""

    def notice_s(self) -> float:
        """How long before it takes off a drone tells the others where it flies."""

    def departs(self) -> None:
        """The drone will leave its place, or turns in flight, because of an order."""

    def is_noticed(self) -> bool:
        """Whether those that it may cut off know where it is about to fly, or had their time."""

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
        self.flights: IDeparts  # set by the node
        # A gateway sets it to its book: order number, outcome and reason of its own drone.
        self.tell_own: Callable[[int, OrderOutcome, str], None] = lambda *_reply: None
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
            starts = self._set_out(goal)
        except GoalRefused as error:
            self._reply(order, OrderOutcome.REFUSED, str(error))
            raise
        for other in self._under_way():
            if other.goal != goal:
                self._reply(other, OrderOutcome.REPLACED, _by(order, other.gateway))
        self._reply(order, OrderOutcome.ACCEPTED)
        if starts:
            self._report(MeshEventKind.FLIGHT_ORDERED, gateway, order=number, place=goal)
            self.flights.departs()
            if self._pilot.departure is None:
                self.flights.took_off()

    def _set_out(self, goal: Location) -> bool:
        """Start the flight, now or after its notice; False if the drone already flies there."""
        self._pilot.check(goal)
        if goal == self._pilot.destination:
            return False
        notice_s = self.flights.notice_s()
        if notice_s:
            self._pilot.departure = goal
            self._deadlines.set(Due.TAKE_OFF, self._deadlines.now_s + notice_s)
        else:
            self._pilot.obey(goal)
        return True

    @due(Due.TAKE_OFF)
    def on_take_off(self) -> None:
        """Begin the flight that the drone has given notice of, if nothing has ended it."""
        self._deadlines.set(Due.TAKE_OFF, math.inf)
        goal = self._pilot.departure
        if goal is None:
            return
        if not self.flights.is_noticed():
            self._deadlines.set(Due.TAKE_OFF, self._deadlines.now_s + LOOK_AGAIN_S)
            return
        try:
            self._pilot.obey(goal)
        except GoalRefused as error:
            self._complaints.add("order given up", str(error), self._deadlines.now_s)
            for order in self._under_way():
                self._reply(order, OrderOutcome.GIVEN_UP, str(error))
        else:
            self.flights.took_off()

    def on_foreign(self, payload: bytes, passed_by: int) -> None:
        """An order from a neighbour whose places may refer to another frame: tell its gateway.

        It is neither flown nor passed on.
        """
        order, number = GoToLocationMessage.from_payload(payload), order_number(payload)
        me, gateway, refused = self._node_id, order.creator, OrderOutcome.REFUSED
        if order.forward == me:
            foreign = _KnownOrder(gateway, number, order.location, refused)
            if number and self._find(gateway, number) is None:
                self._remember(foreign)
            why = f"node {passed_by}, which passed the order on, has another --origin"
            self._reply(foreign, refused, why)
        elif number:
            why = f"node {passed_by} has another --origin"
            for packet in reply_packets(number, refused, why, me, gateway):
                self._control.delivery.send_own(packet)

    @receives(MessageType.ORDER_QUERY)
    def on_query(self, payload: bytes, gateway: int, _from: int) -> None:
        number = OrderQuery.number_in(payload)
        known = self._find(gateway, number)
        if known is None:
            self._send(_KnownOrder(gateway, number, _NOWHERE, OrderOutcome.UNKNOWN))
        else:
            self._reply(known, known.outcome, known.reason)

    def on_landed(self) -> None:
        """Reply to the order whose flight is over, if there was one."""
        pilot, engine = self._pilot, self._engine
        for order in self._under_way():
            here = pilot.location()
            off_m = math.nan if here is None else here.distance_m(order.goal)
            if off_m <= ARRIVED_WITHIN_M:
                self._reply(order, OrderOutcome.ARRIVED)
                continue
            why = engine.why_ended() or engine.why_not_fly()
            if not why and here is not None:
                ends = here.to_vector(), order.goal.to_vector()
                if engine.plan(*ends, self._deadlines.now_s) is None:
                    why = engine.fences().why_not_straight(ends)
            why = why or pilot.flight_end
            where = "its place is not known" if here is None else f"{off_m:.1f} m from the goal"
            self._reply(order, OrderOutcome.GIVEN_UP, f"{why}; {where}")

    @due(Due.ORDER_REPLIES)
    def on_due(self) -> None:
        """Send the replies that had no route before."""
        self._deadlines.set(Due.ORDER_REPLIES, math.inf)
        for order in self._known:
            if order.tries_left:
                self._send(order)

    def _find(self, gateway: int, number: int) -> _KnownOrder | None:
        found = (one for one in self._known if (one.gateway, one.number) == (gateway, number))
        return next(found, None) if number else None

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
            self.tell_own(order.number, outcome, reason)
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
