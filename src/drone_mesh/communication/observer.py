"""Events that the mesh software reports as they happen."""

from __future__ import annotations

import enum
from typing import Callable, NamedTuple

from drone_mesh.communication.deadlines import Deadlines
from drone_mesh.communication.interfaces import NO_ROUTE


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
    FLIGHT_ORDERED = "flight ordered"  # peer: the creator of the order
    LANDED = "landed"
    # Of the drone, reported by its world
    CRASHED = "crashed"
    BATTERY_LOW = "battery low"
    BATTERY_EMPTY = "battery empty"
    GOAL_REFUSED = "goal refused"  # detail: why
    # What a gateway knows of an order; peer: its drone, detail: its number, its goal, and why
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


class MeshEvent(NamedTuple):
    """One event at one node."""

    kind: MeshEventKind
    node: int
    now_s: float
    peer: int = NO_ROUTE  # the other node concerned, or NO_ROUTE
    detail: str = ""  # a short text for display


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
        """Pass an event on."""
        for observer in self._observers:
            observer(event)


class Reporter:
    """Reports the events of one node to its observer."""

    def __init__(self, node_id: int, deadlines: Deadlines, observer: MeshObserver) -> None:
        self._node_id = node_id
        self._deadlines = deadlines
        self._observer = observer

    def __call__(self, kind: MeshEventKind, peer: int = NO_ROUTE, detail: str = "") -> None:
        """Report an event, the other node concerned, and a short text for display."""
        self._observer(MeshEvent(kind, self._node_id, self._deadlines.now_s, peer, detail))
