"""Introduction: when a node introduces itself with a PRESENT (docs/protocol.md, "Connection")."""

from __future__ import annotations

import math
from typing import Callable

from drone_mesh.communication.control.control_plane import IControlHost
from drone_mesh.communication.heartbeats.parts import HeartbeatParts
from drone_mesh.communication.timing.deadlines import Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

AFTER_POWER_S = 0.2  # the medium must register the antenna first
SPREAD_S = 1.0  # spreads the nodes' packets after an outage

_PRESENT = int(MessageType.PRESENT)


class Introduction:
    """Broadcasts the PRESENT of one node, at once or later.

    Called only by the node's component and its parts.
    """

    def __init__(
        self,
        parts: HeartbeatParts,
        node: IControlHost,
        send_heartbeat: Callable[[int], bool],
    ) -> None:
        """`node` provides its connection and hops."""
        self._parts = parts
        self._node = node
        self._frame = parts.frame
        self._rng = parts.rng
        self._send_heartbeat = send_heartbeat
        self._medium = parts.antenna.medium
        self._search_again_s = self._medium.search_s if self._medium.shared else math.inf
        self._is_answer = False  # the planned one answers a node that needs a gateway

    def broadcast(self) -> None:
        """Send PRESENT to each node in range.

        A node without a gateway repeats it, less and less often; off a shared channel only if it
        had one.
        """
        parts, node = self._parts, self._node
        hops, connected = node.get_hops_from_gateway_away(), node.get_connected_to_gateway()
        payload = messages.present(parts.node_id, hops, connected)
        room = messages.EXTENSION_ROOM[_PRESENT] - parts.seals.reserved_bytes(_PRESENT)
        extension = parts.routing.extension(_PRESENT, room)
        if extension:
            payload = messages.extended(payload, extension)
        if self._frame.digest:
            payload = messages.with_frame_digest(payload, self._frame.digest)
        parts.antenna.broadcast_message(payload)
        if connected:
            self._search_again_s = self._medium.search_s
        elif self._search_again_s < math.inf:
            wait_s = self._search_again_s * (0.5 + self._rng.random())
            self._search_again_s = min(2.0 * self._search_again_s, parts.timing.check_period_s)
            self._plan(wait_s)

    def on_due(self) -> None:
        """The planned time has come."""
        self._cancel()
        self._is_answer = False
        self.broadcast()

    def on_power(self, on: bool) -> None:
        """The antenna was switched on or off."""
        if on:
            self._plan(AFTER_POWER_S)
        else:
            self._cancel()

    def on_registered(self) -> None:
        """The medium is back: introduce the node, each node at a different moment."""
        self._plan(AFTER_POWER_S + self._rng.random() * SPREAD_S)

    def answer_search(self, neighbour: int) -> None:
        """Answer a neighbour that needs a gateway: on a shared channel one PRESENT for all."""
        spread_s = self._medium.answer_spread_s
        if not spread_s:
            self._send_heartbeat(neighbour)
        elif self._parts.deadlines.get(Due.INTRODUCE) == math.inf:
            self._is_answer = True
            self._plan(self._rng.random() * spread_s)

    def search_is_answered(self) -> None:
        """Another node answered first: cancel the answer."""
        if self._is_answer:
            self._is_answer = False
            self._cancel()

    def _plan(self, wait_s: float) -> None:
        self._parts.deadlines.set(Due.INTRODUCE, self._parts.now_s + wait_s)

    def _cancel(self) -> None:
        self._parts.deadlines.set(Due.INTRODUCE, math.inf)
