"""RelayCheck: in a mesh with a key, checks whether the next hop relays more than heartbeats.

docs/security.md, "A relay that swallows".
"""

from __future__ import annotations

import logging

from drone_mesh.communication.heartbeats.detours import SWALLOWER_AVOIDED_S, Detours
from drone_mesh.communication.heartbeats.parts import HeartbeatParts
from drone_mesh.communication.heartbeats.swallowing import Swallowing
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.communication.place_requests import ask_for_place

_log = logging.getLogger(__name__)


class RelayCheck:
    """The checks of one router. If packets are swallowed, it finds a detour for heartbeats."""

    def __init__(self, parts: HeartbeatParts, detours: Detours) -> None:
        self._parts = parts
        self._detours = detours
        self._swallowing = Swallowing(parts.timing.check_period_s)
        self._detour = NO_ROUTE

    def run(self, gateway: int, next_hop: int, hops: int) -> bool:
        """Check the route to `gateway`; returns whether the gateway was asked for its place.

        If no answers come, later heartbeats go through another neighbour.
        """
        parts, now_s = self._parts, self._parts.now_s
        sealed = parts.seals.reserved_bytes(MessageType.LOCATION) > 0
        relayed = next_hop not in (gateway, NO_ROUTE)
        if not (sealed and relayed and parts.routing.TAKES_SHORTCUTS):
            return False
        if self._swallowing.noticed(hops):
            self._detours.avoid(next_hop, now_s + SWALLOWER_AVOIDED_S)
            _log.warning(
                "node %d: node %d carries heartbeats to gateway %d, but no other packets",
                parts.node_id,
                next_hop,
                gateway,
            )
        if self._detours.avoids(next_hop, now_s):  # just now, or the route has returned to it
            self._detour = self._detours.nearest(next_hop, hops, now_s)
            if self._detour == NO_ROUTE:
                self._swallowing.give_up()
                self._detours.avoid_none()
            else:
                self._swallowing.another_next_hop(hops)
            return False
        if not self._swallowing.must_ask(now_s):
            return False
        self._swallowing.asked(now_s)
        ask_for_place(parts, gateway)
        return True

    def take_detour(self) -> int:
        """The neighbour to send the next heartbeat through, for one heartbeat; NO_ROUTE: none."""
        detour, self._detour = self._detour, NO_ROUTE
        return detour

    def gateway_sent_place(self) -> None:
        """The gateway itself reported its place."""
        self._swallowing.answered()

    def gateway_changed(self) -> None:
        """The router prefers another gateway; this one may not know its own place."""
        self._swallowing.give_up()
