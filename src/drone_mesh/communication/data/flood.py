"""Flood: fragments to all nodes. Each node repeats each fragment once."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import NamedTuple

from drone_mesh.communication.data import packets
from drone_mesh.communication.data.outgoing import TO_ALL
from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.communication.timing import Deadlines
from drone_mesh.communication.wire import messages

REMEMBERED_S = 5.0  # longer than a fragment takes through the mesh
MOST_REMEMBERED = 1024  # numbers of all senders together
MOST_HEADS = 4  # messages under one number within REMEMBERED_S


class _Repeated(NamedTuple):
    """What has arrived under one number of a sender, which comes again after 256 messages."""

    first_s: float
    heads: tuple[tuple[int, ...], ...] = ()  # fingerprints of its messages, in fragment 0
    indices: int = 0  # of further fragments of the latest one, as bits


@dataclass(eq=False)
class Flood:
    """Broadcasts the fragments of this node, and repeats those of other nodes."""

    _node_id: int
    _antenna: IWirelessCommunication
    _deadlines: Deadlines

    def __post_init__(self) -> None:
        self._seen: OrderedDict[tuple[int, int], _Repeated] = OrderedDict()  # by sender and number

    def send(self, fragment: bytes) -> None:
        """Broadcast a fragment of this node."""
        self._is_new(fragment)
        self._antenna.broadcast_message(fragment)

    def repeat(self, fragment: bytes) -> bool:
        """Broadcast a fragment of another node, unless it has arrived before (False)."""
        if not self._is_new(fragment):
            return False
        onward = messages.next_hop(fragment, self._node_id, TO_ALL)
        if onward is not None:
            self._antenna.broadcast_message(onward)
        return True

    def _is_new(self, fragment: bytes) -> bool:
        """Whether this fragment is new; records it."""
        creator, _from, kind, _to, _forward = messages.header(fragment)
        number, index = messages.body(fragment)[0], kind - packets.FRAGMENTS.start
        key, now_s = (creator, number), self._deadlines.now_s
        seen = self._seen.get(key)
        if seen is None or now_s - seen.first_s >= REMEMBERED_S:
            seen = _Repeated(now_s)
        if index == 0:
            head = packets.head_of(messages.body(fragment)).fingerprint
            if head in seen.heads or len(seen.heads) >= MOST_HEADS:
                return False
            indices = 0 if seen.heads else seen.indices
            seen = _Repeated(seen.first_s, (*seen.heads, head), indices)
        elif seen.indices >> index & 1:
            return False
        else:
            seen = seen._replace(indices=seen.indices | 1 << index)
        self._seen[key] = seen
        self._seen.move_to_end(key)
        while len(self._seen) > MOST_REMEMBERED:
            self._seen.popitem(last=False)
        return True
