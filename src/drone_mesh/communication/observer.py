"""What the mesh software reports about itself, as it happens."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Callable

from drone_mesh.communication.interfaces import NO_ROUTE


class MeshEventKind(enum.Enum):
    """What happened to a node. The value is the word that people see."""

    STARTED = "started"
    CONNECTED = "connected"  # peer: the gateway
    DISCONNECTED = "disconnected"  # peer: the gateway that no longer answers
    GATEWAY_CHANGED = "gateway changed"  # peer: the new one
    NEIGHBOUR_FOUND = "neighbour found"  # peer: it
    NEIGHBOUR_LOST = "neighbour lost"  # peer: it
    NODE_MISSING = "node missing"  # peer: a node that can no longer be reached in any way
    NO_ROUTE = "no route"  # peer: the drone that an order could not be sent to
    POWER_ON = "power on"
    POWER_OFF = "power off"
    EMERGENCY = "emergency"  # the time without a gateway has run out
    NEGOTIATION_STARTED = "negotiation started"  # detail: the own score
    NEGOTIATION_ENDED = "negotiation ended"  # peer: who flies
    FLIGHT_DECIDED = "flight decided"  # peer: the node whose place it takes
    FLIGHT_ORDERED = "flight ordered"  # peer: who made the order
    LANDED = "landed"


@dataclass(frozen=True)
class MeshEvent:
    """One thing that happened to one node."""

    kind: MeshEventKind
    node: int
    now_s: float
    peer: int = NO_ROUTE  # the other node concerned, or NO_ROUTE
    detail: str = ""  # a few words for people


MeshObserver = Callable[[MeshEvent], None]
"""Is called in the thread that works in the component, and must not call back into it."""


def ignore_events(_event: MeshEvent) -> None:
    """The observer of those who do not want to know."""
