"""Flooding: sends every packet once to every neighbour. The baseline of all routing studies."""

from __future__ import annotations

import math
import struct
from collections import OrderedDict
from typing import Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.timing import CIRCULATION_S
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

REMEMBERED = 512  # packets that a node recognises; heartbeats live for a second
REACHABLE_S = 20.0  # two check periods
SEQUENCE = struct.Struct("<H")


class Flooding(ChildTableTree):
    """Needs no routes: knows its neighbours and recognises copies of a packet."""

    FLOODS = True
    TAKES_SHORTCUTS = False

    def __init__(self) -> None:
        super().__init__()
        self._seen_s: OrderedDict[bytes, float] = OrderedDict()
        self._hops: dict[int, int] = {}  # of neighbours, to their gateway
        self._heard_s: dict[int, float] = {}  # by creator
        self._sequence = 0

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        """Only the first copy of a packet counts."""
        self.can_communicate_with_node(from_)
        if kind == MessageType.PRESENT:
            self._hops[from_] = messages.hops(payload)
            return True
        essentials = self._essentials
        now_s, copy = essentials.now_s(), _identity(payload, kind)
        self._heard_s[creator] = now_s
        circulates_s = essentials.medium.stretched(CIRCULATION_S)
        is_first = now_s - self._seen_s.get(copy, -math.inf) >= circulates_s
        if is_first:
            self._seen_s[copy] = now_s
            self._seen_s.move_to_end(copy)
            if len(self._seen_s) > REMEMBERED:
                self._seen_s.popitem(last=False)
        return is_first

    def directions(self, node: int, came_from: int, creator: int) -> Sequence[int]:
        """The node itself if it is a neighbour, else all neighbours except `came_from`."""
        children = self.get_set_of_children()
        if node in children:
            return (node,)
        return tuple(sorted(children - {came_from, creator}))

    def get_direction_to_node(self, node: int) -> int:
        """For display and repair: the neighbour with the fewest hops to its gateway.

        NO_ROUTE for a node that was not heard recently, although packets for it would be flooded.
        """
        children = self.get_set_of_children()
        if node in children:
            return node
        if not children:
            return NO_ROUTE
        if self._essentials.now_s() - self._heard_s.get(node, -math.inf) > REACHABLE_S:
            return NO_ROUTE
        return min(children, key=lambda child: (self._hops.get(child, NO_ROUTE), child))

    def extension(self, kind: int, room: int) -> bytes:
        """A number that distinguishes heartbeats."""
        if kind != MessageType.HEARTBEAT:
            return b""
        self._sequence = (self._sequence + 1) % 2**16
        return SEQUENCE.pack(self._sequence)

    def proven_path_to_node(self, other: int, node: int) -> None:
        """Nothing to do: there are no routes to prove."""

    def other_can_communicate_with_node(self, other: int, node: int) -> None:
        self.can_communicate_with_node(other)

    def gateway_lost(self, gateway: int) -> bool:
        """No route to drop, and nothing to report to neighbours."""
        self._heard_s.pop(gateway, None)
        return False

    def cant_communicate_with_node(self, node: int) -> int:
        """Remove a neighbour; it may still be reachable."""
        self._hops.pop(node, None)
        super().cant_communicate_with_node(node)
        return 0


def _identity(payload: bytes, kind: int) -> bytes:
    """The bytes that all copies share: for a heartbeat its sequence number, not its hops."""
    if kind == MessageType.HEARTBEAT:
        creator, _from, _kind, _to, forward = messages.header(payload)
        return bytes((creator, forward, kind)) + messages.extension(payload)[: SEQUENCE.size]
    return messages.identity(payload)
