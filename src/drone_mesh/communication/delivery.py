"""Delivery: handing packets to neighbours, and telling the others who cannot be reached any more.

Reference, section 8 ("Sending", "MISSING").
"""

from __future__ import annotations

from collections import deque
from typing import Callable, Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.interfaces import (
    NO_ROUTE,
    IRoutingTechnique,
    IWirelessCommunication,
)
from drone_mesh.communication.messages import MessageType
from drone_mesh.communication.observer import MeshEventKind

NodeReport = Callable[[MeshEventKind, int], None]
"""Takes what happened, and to which other node."""


class Delivery:
    """The packets that one node sends, what the routes learn from that, and who got lost by it.

    Belongs to the component of its node, and is called by nobody else.
    """

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        routing: IRoutingTechnique,
        attempts: int,
        report: NodeReport,
        on_neighbour_lost: Callable[[int], None],
    ) -> None:
        """`attempts`: how often a packet is handed over before its receiver counts as lost."""
        self._node_id = node_id
        self._antenna = antenna
        self._routing = routing
        self._attempts = attempts
        self._report = report
        self._on_neighbour_lost = on_neighbour_lost
        self._missing_to_tell: deque[tuple[int, int, int]] = deque()
        self._telling = False
        self.heard_s: dict[int, float] = {}  # direct neighbours, and when each was last heard
        self.total_sent = 0

    # Sending ---------------------------------------------------------------------------------

    def send(self, payload: bytes, to: int, failures: int = 0, came_from: int = NO_ROUTE) -> bool:
        """Hand a packet to neighbour `to`, more than once if need be. The routes learn from it.

        `failures`: how often that was tried in vain before; `came_from`: who hears of it first if
        the neighbour turns out to be lost.
        """
        for _attempt in range(failures, self._attempts):
            if self._antenna.send_message_to(payload):
                self._sent(to)
                return True
        self._neighbour_lost(to, came_from)
        return False

    def send_own(self, kind: int, other: int, body: bytes = b"") -> bool:
        """Send a packet of our own towards `other`, over one route after the other."""
        me = self._node_id
        tried: list[int] = []
        while True:
            to = self._routing.get_direction_to_node(other)
            if to == NO_ROUTE or to in tried:
                return False
            if self.send(messages.packet(kind, me, me, to, other, body), to):
                return True
            tried.append(to)

    def send_own_to_each(self, kind: int, others: Sequence[int], body: bytes) -> None:
        """As `send_own` to each of these; the packets for direct neighbours leave together."""
        me, routing = self._node_id, self._routing
        direct = [other for other in others if routing.get_direction_to_node(other) == other]
        packets = [messages.packet(kind, me, me, other, other, body) for other in direct]
        for other, packet, taken in zip(direct, packets, self._antenna.send_messages(packets)):
            if taken:
                self._sent(other)
            elif not self.send(packet, other, failures=1):
                self.send_own(kind, other, body)
        for other in set(others).difference(direct):
            self.send_own(kind, other, body)

    def _sent(self, to: int) -> None:
        self.total_sent += 1
        self._routing.can_communicate_with_node(to)

    # Lost nodes ------------------------------------------------------------------------------

    def forget_route(self, other: int, node: int, told_by: int) -> None:
        """`other` cannot reach `node`; if that was the last route, the others have to know."""
        if other == node:
            self.heard_s.pop(node, None)
        if self._routing.other_cant_communicate_with_node(other, node):
            self._report(MeshEventKind.NODE_MISSING, node)
            self.tell_missing(node, told_by=told_by)

    def drop_routes_to(self, node: int) -> None:
        """Forget every way to `node`, one after the other.

        A technique that keeps a way nevertheless is not asked again.
        """
        tried: list[int] = []
        while True:
            to = self._routing.get_direction_to_node(node)
            if to == NO_ROUTE or to in tried:
                return
            tried.append(to)
            if to == node:
                self.heard_s.pop(node, None)
                self._routing.cant_communicate_with_node(node)
            else:
                self._routing.other_cant_communicate_with_node(to, node)

    def tell_missing(self, missing: int, first: int = NO_ROUTE, told_by: int = NO_ROUTE) -> None:
        """MISSING to every neighbour, `first` before the others and `told_by` not at all.

        A neighbour that cannot be told is lost itself: that is told after this, not within it, so
        that the depth of the call does not grow with the number of neighbours.
        """
        self._missing_to_tell.append((missing, first, told_by))
        if self._telling:
            return
        self._telling = True
        try:
            while self._missing_to_tell:
                missing, first, told_by = self._missing_to_tell.popleft()
                body = bytes((missing,))
                neighbours = self._routing.get_set_of_children() - {missing, told_by}
                for neighbour in sorted(neighbours, key=lambda n: (n != first, n)):
                    if self._routing.get_direction_to_node(neighbour) == neighbour:
                        self.send_own(MessageType.MISSING, neighbour, body)
        finally:
            self._telling = False

    def _neighbour_lost(self, node: int, came_from: int) -> None:
        if self.heard_s.pop(node, None) is not None:
            self._report(MeshEventKind.NEIGHBOUR_LOST, node)
        if self._routing.cant_communicate_with_node(node):
            self._report(MeshEventKind.NODE_MISSING, node)
            self.tell_missing(node, first=came_from)
        self._on_neighbour_lost(node)
