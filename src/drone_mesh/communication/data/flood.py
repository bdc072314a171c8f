"""Flood: fragments to all nodes. Each node repeats each fragment once."""

from __future__ import annotations

from collections import OrderedDict

from drone_mesh.communication import messages
from drone_mesh.communication.data import packets
from drone_mesh.communication.data.ticket import TO_ALL
from drone_mesh.communication.parts import NodeParts

REMEMBERED_S = 5.0  # our choice: sending 256 messages takes longer, so no number recurs
MOST_REMEMBERED = 1024  # messages of all senders together


class Flood:
    """Broadcasts the fragments of this node, and repeats those of other nodes."""

    def __init__(self, parts: NodeParts) -> None:
        self._parts = parts
        # By sender and message: its fragments that arrived, as bits, and when the first one did
        self._seen: OrderedDict[tuple[int, int], tuple[int, float]] = OrderedDict()

    def send(self, fragment: bytes) -> None:
        """Broadcast a fragment of this node."""
        self._is_new(fragment)
        self._parts.antenna.broadcast_message(fragment)

    def repeat(self, fragment: bytes) -> bool:
        """Broadcast a fragment of another node, unless it has arrived before (False)."""
        if not self._is_new(fragment):
            return False
        onward = messages.next_hop(fragment, self._parts.node_id, TO_ALL)
        if onward is not None:
            self._parts.antenna.broadcast_message(onward)
        return True

    def _is_new(self, fragment: bytes) -> bool:
        """Whether this fragment is new; records it."""
        creator, _from, kind, _to, _forward = messages.header(fragment)
        number, index = messages.body(fragment)[0], kind - packets.FRAGMENTS.start
        key, now_s = (creator, number), self._parts.now_s
        indices, first_s = self._seen.get(key, (0, now_s))
        if now_s - first_s >= REMEMBERED_S:  # the number now belongs to another message
            indices, first_s = 0, now_s
        if indices >> index & 1:
            return False
        self._seen[key] = indices | 1 << index, first_s
        while len(self._seen) > MOST_REMEMBERED:
            self._seen.popitem(last=False)
        return True
