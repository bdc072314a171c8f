"""QueuedDelivery: on a shared channel the antenna queues packets and reports their fate later.

docs/protocol.md, "Sending" and "Missing nodes"; docs/shared-channel.md.
"""

from __future__ import annotations

import math

from drone_mesh.communication.heartbeats.delivery import Delivery
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.wire import messages


class QueuedDelivery(Delivery):
    """Hands packets over once; one that is given up takes another route, and few are told of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._reported_s: dict[int, float] = {}  # when each missing node was announced
        self._gave_up: set[int] = set()  # neighbours that were heard but took no packets

    def _transmit(self, payload: bytes, to: int, failures: int, came_from: int) -> bool:
        taken = self._antenna.send_message_to(payload)
        self.total_sent += taken
        return taken

    def undelivered(self, payload: bytes, tries: int) -> bool:
        """The antenna gave up a packet. Returns whether the packet takes another route.

        A neighbour that was heard recently counts as lost only after two failures in a row, because
        the channel may be busy.
        """
        to, other = messages.receiver(payload), messages.addressee(payload)
        is_known = self._routing.get_direction_to_node(other) != NO_ROUTE
        self.total_sent -= 1
        self._routing.sent(to, False, tries)
        silent_since_s = self._deadlines.now_s - self._antenna.medium.silence_s
        heard = self._neighbours.last_heard_s(to, otherwise=silent_since_s) > silent_since_s
        if messages.asks_for_place(payload):
            pass  # others decide: who keeps only these from arriving must not cut a mesh
        elif heard and messages.is_data(payload):
            pass  # users' packets crowd the channel; their loss says little about a heard neighbour
        elif heard and to not in self._gave_up:
            self._gave_up.add(to)
        else:
            self._gave_up.discard(to)
            self.neighbour_lost(to)
        detour = self._routing.get_direction_to_node(other)
        if detour in (NO_ROUTE, to) and other != to:
            by_default = messages.is_data(payload) and not is_known
            detour = self._ways.way_up(to) if by_default else self._ways.another_next_hop(other, to)
        if detour in (NO_ROUTE, to):
            return False
        return self.send(messages.readdressed(payload, detour), detour)

    def report_missing(
        self, missing: int, first: int = NO_ROUTE, reported_by: int = NO_ROUTE
    ) -> None:
        """Send one MISSING to all neighbours, unless the same was sent a moment ago."""
        now_s, me = self._deadlines.now_s, self._node_id
        if now_s - self._reported_s.get(missing, -math.inf) < self._antenna.medium.missing_quiet_s:
            return
        self._reported_s[missing] = now_s
        self._antenna.broadcast_message(
            messages.MissingMessage(me, me, BROADCAST, BROADCAST, missing).to_payload()
        )

    def came_back(self, missing: int, neighbour: int) -> None:
        """Tell only that neighbour: for all others the route still works."""
        me = self._node_id
        packet = messages.MissingMessage(me, me, neighbour, neighbour, missing)
        self.send(packet.to_payload(), neighbour)
