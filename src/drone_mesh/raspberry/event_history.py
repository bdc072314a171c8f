"""EventHistory: recent events of the nodes of one program, for the log and for readers."""

from __future__ import annotations

import logging
import threading
from collections import deque
from typing import Any

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind, Observers
from drone_mesh.communication.interfaces import MAX_NODE_ID

EVENTS_KEPT = 500  # an hour of a mesh with frequent changes

_ABOUT_GATEWAYS = frozenset(
    (MeshEventKind.CONNECTED, MeshEventKind.DISCONNECTED, MeshEventKind.GATEWAY_CHANGED)
)
_WITHOUT_LINE = frozenset(  # what fails has a line of the order book
    (
        MeshEventKind.NO_ROUTE,
        MeshEventKind.FLIGHT_ORDERED,
        MeshEventKind.ORDER_REFUSED,
        MeshEventKind.ORDER_LOST_CONTACT,
        MeshEventKind.ORDER_GIVEN_UP,
    )
)

_log = logging.getLogger(__name__)


class EventHistory:
    """Recent events; any thread may use it. The lock is held only while they are copied."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._number = 0
        self._kept: deque[tuple[int, MeshEvent]] = deque(maxlen=EVENTS_KEPT)
        self.others = Observers()  # that also get each event

    def observe(self, event: MeshEvent) -> None:
        """A MeshObserver."""
        with self._lock:
            self._number += 1
            self._kept.append((self._number, event))
        _log_event(event)
        self.others(event)

    def since(self, number: int, started_s: float) -> list[dict[str, Any]]:
        """Events after this number, oldest first, as JSON values; times since `started_s`."""
        with self._lock:
            kept = list(self._kept)
        return [
            {
                "number": at,
                "t": round(event.now_s - started_s, 2),
                "node": event.node,
                "kind": event.kind.value,
                "peers": [event.peer] if event.peer <= MAX_NODE_ID else [],
                "detail": event.detail,
                "order": event.order or None,
                "place": event.place,
            }
            for at, event in kept
            if at > number
        ]


def _log_event(event: MeshEvent) -> None:
    """Log one line per event; orders that were lost or flown have their own lines already."""
    if event.kind in _WITHOUT_LINE:
        return
    words = event.kind.value
    if event.peer <= MAX_NODE_ID:
        peer = "gateway" if event.kind in _ABOUT_GATEWAYS else "node"
        words += f": {peer} {event.peer}"
    why = event.explanation()
    if why:
        words += f" ({why})"
    level = logging.WARNING if event.kind is MeshEventKind.EMERGENCY else logging.INFO
    _log.log(level, "node %d: %s", event.node, words)
