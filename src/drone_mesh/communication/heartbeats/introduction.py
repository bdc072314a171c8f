"""Introduction: what a node says of itself in PRESENT and HEARTBEAT, and when it does.

docs/protocol.md, "Connection".
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Protocol

from drone_mesh.communication.control.node_part import due
from drone_mesh.communication.control.places import CommonFrame
from drone_mesh.communication.interfaces import IMeshSeals, IWirelessCommunication
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

AFTER_POWER_S = 0.2  # the medium must register the antenna first
SPREAD_S = 1.0  # spreads the nodes' packets after an outage

_PRESENT, _HEARTBEAT = int(MessageType.PRESENT), int(MessageType.HEARTBEAT)


class IIntroduced(Protocol):
    """The control plane, as far as an introduction needs it."""

    @property
    def offered_hops(self) -> int: ...

    @property
    def connected(self) -> bool: ...

    def send_heartbeat(self, other: int) -> bool: ...


@dataclass(eq=False)
class Introduction:
    """Broadcasts the PRESENT of one node, at once or later, and makes its heartbeats."""

    _node_id: int
    _plane: IIntroduced
    _technique: IRoutingTechnique
    _antenna: IWirelessCommunication
    _seals: IMeshSeals
    _deadlines: Deadlines
    _check_period_s: float
    _frame: CommonFrame
    _rng: random.Random

    def __post_init__(self) -> None:
        self._room = {
            kind: messages.EXTENSION_ROOM[kind] - self._seals.reserved_bytes(kind)
            for kind in (_PRESENT, _HEARTBEAT)
        }
        self._medium = self._antenna.medium
        from_start = self._medium.policy.searches_from_start
        self._search_again_s = self._medium.search_s if from_start else math.inf
        self._is_answer = False  # the planned one answers a node that needs a gateway

    def broadcast(self) -> None:
        """Send PRESENT to each node in range.

        A node without a gateway repeats it, less and less often; off a shared channel only if it
        had one.
        """
        hops, connected = self._plane.offered_hops, self._plane.connected
        payload = self._extended(messages.present(self._node_id, hops, connected), _PRESENT)
        if self._frame.digest:
            payload = messages.with_frame_digest(payload, self._frame.digest)
        self._antenna.broadcast_message(payload)
        if connected:
            self._search_again_s = self._medium.search_s
        elif self._search_again_s < math.inf:
            wait_s = self._search_again_s * (0.5 + self._rng.random())
            self._search_again_s = min(2.0 * self._search_again_s, self._check_period_s)
            self._plan(wait_s)

    def heartbeat(self, to: int, forward: int, connected: bool, gateway: int) -> bytes:
        me = self._node_id
        return self._extended(
            messages.heartbeat(me, me, to, forward, connected, gateway), _HEARTBEAT
        )

    def _extended(self, payload: bytes, kind: int) -> bytes:
        """With the bytes of the technique."""
        extension = self._technique.extension(kind, self._room[kind])
        return messages.extended(payload, extension) if extension else payload

    @due(Due.INTRODUCE)
    def on_due(self) -> None:
        """The planned time has come."""
        self._cancel()
        self._is_answer = False
        self.broadcast()

    def on_power(self, on: bool) -> None:
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
            self._plane.send_heartbeat(neighbour)
        elif self._deadlines.at_s[Due.INTRODUCE] == math.inf:
            self._is_answer = True
            self._plan(self._rng.random() * spread_s)

    def search_is_answered(self) -> None:
        """Another node answered first: cancel the answer."""
        if self._is_answer:
            self._is_answer = False
            self._cancel()

    def _plan(self, wait_s: float) -> None:
        self._deadlines.set(Due.INTRODUCE, self._deadlines.now_s + wait_s)

    def _cancel(self) -> None:
        self._deadlines.set(Due.INTRODUCE, math.inf)
