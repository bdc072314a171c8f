"""AckTurns: the senders to one node take turns on a busy channel.

A sender behind relays sends a few messages and waits for an ACK. Many senders congest a channel
also with one message each, and each sees only its own failures: what they decide alone is unstable
and unfair. Their receiver sees them all. It answers one of them at a time, in the order in which
their ACKs became due, and the next one after the messages that this answer brought, or, if none
come, after a pause. So the ACKs admit senders (receiver-driven transport; Montazeri et al., Homa,
2018), and each has the same share, whatever its number of hops.
"""

from __future__ import annotations

import math
from typing import Callable, Iterable

from drone_mesh.communication.data.inbox import Inbox
from drone_mesh.communication.timing import FAST_HOP_S, Medium

# At 250 kbit/s and per check period of patience: up to 1 s, a first timeout (RFC 6298).
TURN_S = 0.4


class AckTurns:
    """The order of the ACKs of one node."""

    def __init__(self, medium: Medium, patience: Callable[[], float]) -> None:
        """`patience`: see IWirelessCommunication; 0 on a quiet channel, where no ACK waits."""
        self._turn_s = TURN_S * (medium.hop_s / FAST_HOP_S)
        self._patience = patience
        self._latest: Inbox | None = None  # acknowledged last
        self._ends_s = -math.inf  # at the latest

    def next_s(self, inboxes: Iterable[Inbox]) -> float:
        """When the next ACK leaves; infinity if none is due."""
        due_s = min((inbox.ack_due_s for inbox in inboxes), default=math.inf)
        if self._latest is None:
            return due_s
        return max(due_s, min(self._ends_s, self._latest.ack_due_s))

    def acknowledge(self, inboxes: Iterable[Inbox], now_s: float) -> None:
        """Send the ACK that has been due for longest."""
        self._latest = min(inboxes, key=lambda inbox: inbox.ack_due_s)
        self._latest.acknowledge()
        self._ends_s = now_s + self._turn_s * self._patience()
