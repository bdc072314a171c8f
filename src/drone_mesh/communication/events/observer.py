"""Events that the mesh software reports as they happen."""

from __future__ import annotations

import enum
from typing import Callable, Iterable, NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location


class MeshEventKind(enum.Enum):
    """The kind of an event. The value is the text that views display."""

    STARTED = "started"
    CONNECTED = "connected"  # peer: the gateway
    DISCONNECTED = "disconnected"  # peer: the gateway that no longer answers
    GATEWAY_CHANGED = "gateway changed"  # peer: the new one
    NEIGHBOUR_FOUND = "neighbour found"  # peer: the neighbour
    NEIGHBOUR_LOST = "neighbour lost"  # peer: the neighbour
    NODE_MISSING = "node missing"  # peer: a node that is no longer reachable
    NO_ROUTE = "no route"  # peer: the drone whose order could not be sent
    POWER_ON = "power on"
    POWER_OFF = "power off"
    EMERGENCY = "emergency"  # no gateway answered for too long
    NEGOTIATION_STARTED = "negotiation started"  # detail: the node's score
    NEGOTIATION_ENDED = "negotiation ended"  # peer: the node that flies
    FLIGHT_DECIDED = "flight decided"  # peer: the node whose place it takes
    FLIGHT_ORDERED = "flight ordered"  # peer: the gateway of the order; with its number and place
    LANDED = "landed"
    # Of the drone, reported by its world
    CRASHED = "crashed"
    BATTERY_LOW = "battery low"
    BATTERY_EMPTY = "battery empty"
    GOAL_REFUSED = "goal refused"  # detail: why
    # What a gateway knows of an order; peer: its drone, with number and place; detail: why
    ORDER_SENT = "order sent"
    ORDER_ACCEPTED = "order accepted"
    ORDER_REFUSED = "order refused"
    ORDER_ARRIVED = "order arrived"
    ORDER_GIVEN_UP = "order given up"
    # About a drone; a real gateway derives them from the reports of its node
    TOOK_OFF = "took off"
    CANNOT_FLY = "cannot fly"  # detail: why
    CAN_FLY = "can fly again"
    # Of an order, too
    ORDER_REPLACED = "order replaced"
    ORDER_LOST_CONTACT = "order lost contact"
    OUTSIDE_FENCE = "outside the fence"  # of the drone; detail: which area, and on which side


class MeshEvent(NamedTuple):
    """One event at one node."""

    kind: MeshEventKind
    node: int
    now_s: float
    peer: int = NO_ROUTE  # the other node concerned, or NO_ROUTE
    detail: str = ""  # why, as a short text for display
    order: int = 0  # the number of the order that it is about; 0: none, or it is not known
    place: Location | None = None  # where that order sends the drone

    def explanation(self) -> str:
        """See the function."""
        return explanation(self.order, self.place, self.detail)


def explanation(order: int, place: Location | None, detail: str = "") -> str:
    """What views display behind the kind: order 7 to x 1.00 m, y 2.00 m, z 3 m: battery at 9 %."""
    number = f"order {order}" if order else ""
    goal = "" if place is None else f"to {place.in_words()}"
    return ": ".join(filter(None, (" ".join(filter(None, (number, goal))), detail)))


_ABOUT_GATEWAYS = (
    MeshEventKind.CONNECTED, MeshEventKind.DISCONNECTED, MeshEventKind.GATEWAY_CHANGED,
)  # fmt: skip


def told(kind: MeshEventKind, peers: Iterable[int], why: str) -> str:
    """An event as a line says it: connected: gateway 0 (2 hops)."""
    others = " ".join(str(peer) for peer in peers if peer != NO_ROUTE)
    whom = f": {'gateway' if kind in _ABOUT_GATEWAYS else 'node'} {others}" if others else ""
    return f"{kind.value}{whom}{f' ({why})' if why else ''}"


def in_hops(hops: int) -> str:
    """A number of hops as text: "1 hop", "2 hops"."""
    return "1 hop" if hops == 1 else f"{hops} hops"


MeshObserver = Callable[[MeshEvent], None]
"""Called in the thread that runs the component; must not call back into the component."""


def ignore_events(_event: MeshEvent) -> None:
    """An observer that does nothing."""


class Observers:
    """An observer that passes each event to several others."""

    def __init__(self, *observers: MeshObserver) -> None:
        self._observers = list(observers)

    def add(self, observer: MeshObserver) -> None:
        """Also pass each event to this one. Before the nodes start."""
        self._observers.append(observer)

    def __call__(self, event: MeshEvent) -> None:
        for observer in self._observers:
            observer(event)


class Reporter:
    """Reports the events of one node to its observer."""

    def __init__(self, node_id: int, deadlines: Deadlines, observer: MeshObserver) -> None:
        self._node_id = node_id
        self._deadlines = deadlines
        self._observer = observer

    def __call__(
        self,
        kind: MeshEventKind,
        peer: int = NO_ROUTE,
        detail: str = "",
        order: int = 0,
        place: Location | None = None,
    ) -> None:
        """Report an event of this node, with the fields of a MeshEvent."""
        now_s = self._deadlines.now_s
        self._observer(MeshEvent(kind, self._node_id, now_s, peer, detail, order, place))
