"""NodeSearch: a gateway searches for a node without a known route.

For its orders: a relay that loses a neighbour loses the routes to all nodes behind it, and learns
new ones only from packets of those nodes, which may be silent for minutes (docs/protocol.md,
"Searching for a drone"). For users' data: the node may use another gateway ("Users' data for
unknown nodes").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Callable

from drone_mesh.communication.control.control_plane import NUMBERS_PER_S
from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.interfaces import BROADCAST, IWirelessCommunication
from drone_mesh.communication.timing import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

BODY = MessageType.NODE_SEARCH.about.layout
SAME_SEARCH_S = 10.0  # far longer than a search takes to pass through a mesh
FIRST_PAUSE_S = 1.0  # a search passes through 100 nodes within half a second
LONGEST_PAUSE_S = 60.0  # a search in vain doubles the pause, up to this


@dataclass(eq=False)
class NodeSearch:
    """Searches of one node, and its part in others' searches. Called only by its component."""

    _node_id: int
    _antenna: IWirelessCommunication
    _deadlines: Deadlines
    _complaints: Complaints
    _answer: Callable[[int], bool]  # sends a heartbeat to the gateway that searches for this node

    def __post_init__(self) -> None:
        self._medium = self._antenna.medium
        self._searched_s = -math.inf
        self._pauses_s: dict[int, tuple[float, float]] = {}  # by node: until when, and the next one
        self._seen_s: dict[tuple[int, int, int], float] = {}  # creator, node, number

    def search(self, node: int) -> bool:
        """Broadcast a search for `node`. False: too soon after another search."""
        now_s = self._deadlines.now_s
        if now_s - self._searched_s < self._medium.stretched(self._medium.policy.search_pause_s):
            return False
        self._searched_s = now_s
        number = int(now_s * NUMBERS_PER_S) % 2**16
        self._broadcast(self._node_id, node, number)
        return True

    def seek(self, node: int) -> None:
        """Search for `node`, unless that was in vain a moment ago."""
        now_s = self._deadlines.now_s
        until_s, pause_s = self._pauses_s.get(node, (-math.inf, FIRST_PAUSE_S))
        if pause_s > 2.0 * FIRST_PAUSE_S:
            self._complaints.add(f"no route to node {node}", "users' data ends here", now_s)
        if now_s >= until_s and self.search(node):
            until_s = now_s + self._medium.stretched(pause_s)
            self._pauses_s[node] = until_s, min(2.0 * pause_s, LONGEST_PAUSE_S)

    def found(self, node: int) -> None:
        self._pauses_s.pop(node, None)

    @receives(MessageType.NODE_SEARCH)
    def on_packet(self, payload: bytes, creator: int, _from: int) -> None:
        """Answer a search for this node; forward any other search, once."""
        node, number = BODY.unpack_from(payload, messages.HEADER_BYTES)
        now_s, search = self._deadlines.now_s, (creator, node, number)
        old = [seen for seen, at_s in self._seen_s.items() if now_s - at_s >= SAME_SEARCH_S]
        for seen in old:
            del self._seen_s[seen]
        if creator == self._node_id or search in self._seen_s:
            return
        self._seen_s[search] = now_s
        if node == self._node_id:
            self._answer(creator)
        else:
            self._broadcast(creator, node, number)

    def _broadcast(self, creator: int, node: int, number: int) -> None:
        me, kind = self._node_id, MessageType.NODE_SEARCH
        self._antenna.broadcast_message(
            messages.packet(kind, creator, me, BROADCAST, BROADCAST, BODY.pack(node, number))
        )
