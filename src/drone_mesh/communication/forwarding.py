"""Forwarding: sending packets on that are for somebody else (reference, section 8)."""

from __future__ import annotations

from drone_mesh.communication import messages
from drone_mesh.communication.circulation import CirculationGuard
from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.delivery import Delivery, NodeReport
from drone_mesh.communication.interfaces import NO_ROUTE, IRoutingTechnique
from drone_mesh.communication.messages import MessageType
from drone_mesh.communication.observer import MeshEventKind


class Forwarding:
    """What one node does with packets that have further to go.

    Belongs to the component of its node, and is called by nobody else.
    """

    def __init__(
        self,
        node_id: int,
        routing: IRoutingTechnique,
        delivery: Delivery,
        complaints: Complaints,
        report: NodeReport,
    ) -> None:
        self._node_id = node_id
        self._routing = routing
        self._delivery = delivery
        self._complaints = complaints
        self._report = report
        self._circulation = CirculationGuard()

    def forward(self, payload: bytes, now_s: float) -> None:
        """Send a packet on towards its addressee; drop it if it goes round or has no way to go."""
        creator, from_, kind, _to, forward = payload[: messages.HEADER_BYTES]
        routing = self._routing
        identity = b""
        if creator == self._node_id:
            self._drop_circulating(payload, routing.get_direction_to_node(forward), now_s)
            return
        if kind != MessageType.HEARTBEAT:
            identity = messages.identity(payload)
            first = self._circulation.came_round(identity, from_, now_s)
            if first is not None:
                self._drop_circulating(payload, first.went_to, now_s)
                return
        lost = NO_ROUTE
        for _attempt in range(2):
            to = routing.get_direction_to_node(forward)
            if to in (NO_ROUTE, from_):
                self._stranded(kind, forward, now_s)
                if to == from_ or lost != forward:  # else all were told when it was lost
                    self._delivery.tell_missing(forward, first=from_)
                return
            sent_on = messages.next_hop(payload, self._node_id, to)
            if sent_on is None:
                self._complaints.dropped("a heartbeat with too many hops", payload, now_s)
                return
            if self._delivery.send(sent_on, to, came_from=from_):
                if identity:
                    self._circulation.passed(identity, from_, to, now_s)
                return
            lost = to
        self._stranded(kind, forward, now_s)

    def _drop_circulating(self, payload: bytes, used: int, now_s: float) -> None:
        kind, forward = payload[messages.TYPE], payload[messages.FORWARD]
        self._complaints.dropped("a packet that goes round in circles", payload, now_s)
        if used not in (forward, NO_ROUTE):
            self._routing.other_cant_communicate_with_node(used, forward)
        self._stranded(kind, forward, now_s)

    def _stranded(self, kind: int, forward: int, now_s: float) -> None:
        """People want to know of an order that goes no further, though its gateway had a route."""
        if kind == MessageType.MOVE_TO_LOCATION:
            reason = f"no route to drone {forward}"
            self._complaints.add(reason, "an order for it ends here", now_s)
            self._report(MeshEventKind.NO_ROUTE, forward)
