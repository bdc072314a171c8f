"""Recent events of the nodes of one program, and those of other nodes that a gateway derives."""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Any, Sequence

from drone_mesh.communication.events.observer import (
    MeshEvent,
    MeshEventKind,
    MeshObserver,
    Observers,
    told,
)
from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE, KnownNode
from drone_mesh.communication.reports import ReportedNode

EVENTS_KEPT = 500  # an hour of a mesh with frequent changes

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
    words = told(event.kind, [event.peer], event.explanation())
    level = logging.WARNING if event.kind is MeshEventKind.EMERGENCY else logging.INFO
    _log.log(level, "node %d: %s", event.node, words)


LOST_AFTER_CHECKS = 3  # a route that is missing for a moment is not an event


@dataclass
class _Seen:
    """The values of a node at the last call."""

    connected: bool = False
    routed_s: float = -math.inf  # when the gateway last had a route to it
    flying: bool = False
    why_not_fly: str = ""


class NodeChanges:
    """Compares a gateway's knowledge of its routers with that of the previous call. One thread."""

    def __init__(self, gateway: int, check_period_s: float, observer: MeshObserver) -> None:
        """`observer` is called with each event; the event's node is the router."""
        self._gateway = gateway
        self._lost_after_s = LOST_AFTER_CHECKS * check_period_s
        self._observer = observer
        self._seen: dict[int, _Seen] = {}

    def compare(
        self, known: Sequence[KnownNode], reported: Sequence[ReportedNode], now_s: float
    ) -> None:
        """Report what has changed since the last call; times are those of the core's clock."""
        routed = {node.node_id for node in known if node.next_hop != NO_ROUTE}
        for node_id in sorted(routed | self._seen.keys()):
            self._note_connection(node_id, node_id in routed, now_s)
        for report in reported:
            if math.isfinite(report.heard_s):
                self._note_flight(report, now_s)

    def _note_connection(self, node_id: int, has_route: bool, now_s: float) -> None:
        seen = self._seen.setdefault(node_id, _Seen())
        if has_route:
            seen.routed_s = now_s
        connected = now_s - seen.routed_s <= self._lost_after_s
        if connected is not seen.connected:
            seen.connected = connected
            if connected:
                self._report(MeshEventKind.CONNECTED, node_id, now_s, self._gateway)
            else:
                detail = f"no route to it for {self._lost_after_s:g} s"
                self._report(MeshEventKind.DISCONNECTED, node_id, now_s, self._gateway, detail)

    def _note_flight(self, node: ReportedNode, now_s: float) -> None:
        seen = self._seen.setdefault(node.node_id, _Seen())
        if node.report.flying is not seen.flying:
            seen.flying = node.report.flying
            kind = MeshEventKind.TOOK_OFF if seen.flying else MeshEventKind.LANDED
            self._report(kind, node.node_id, now_s)
        if node.why_not_fly != seen.why_not_fly:
            seen.why_not_fly = node.why_not_fly
            kind = MeshEventKind.CANNOT_FLY if seen.why_not_fly else MeshEventKind.CAN_FLY
            self._report(kind, node.node_id, now_s, detail=seen.why_not_fly)

    def _report(
        self, kind: MeshEventKind, node: int, now_s: float, peer: int = NO_ROUTE, detail: str = ""
    ) -> None:
        self._observer(MeshEvent(kind, node, now_s, peer, detail))
