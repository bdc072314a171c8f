"""NodeChanges: events of other nodes, derived from the packets that their gateway receives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Sequence

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind, MeshObserver
from drone_mesh.communication.interfaces import NO_ROUTE, KnownNode
from drone_mesh.communication.reports import ReportedNode

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
