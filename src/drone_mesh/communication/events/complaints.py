"""Counts what was dropped, and logs it at a limited rate."""

from __future__ import annotations

import logging
import math
from typing import Final

from drone_mesh.communication.timing import Throttle

COMPLAINT_PERIOD_S: Final = 30.0  # one line per reason and node in this time
FOREIGN_FOR_S: Final = 60.0  # a neighbour sends several packets in this time
CHALLENGED_FOR_S: Final = 10.0  # a neighbour with a key challenges one without every 2 s

_log = logging.getLogger(__name__)


class Complaints:
    """Counts problems of one node, by reason. Belongs to the thread that runs the node."""

    def __init__(self, node_id: int) -> None:
        self._node_id = node_id
        self._throttle = Throttle(COMPLAINT_PERIOD_S)
        self._foreign = ("", -math.inf)
        self._foreign_s: dict[int, float] = {}  # by neighbour: when
        self.counts = self._throttle.counts

    def add(self, reason: str, detail: str, now_s: float) -> None:
        """Count `reason`; log it with `detail` unless it was logged within the last period."""
        if self._throttle.count(reason, now_s):
            count = self.counts[reason]
            _log.warning("node %d: %s: %s (%d so far)", self._node_id, reason, detail, count)

    def foreign(self, neighbour: int, reason: str, payload: bytes, now_s: float) -> None:
        """A neighbour has another key than this node, or only one of the two has a key."""
        self._foreign = (reason, now_s)
        self._foreign_s[neighbour] = now_s
        self.add(reason, payload.hex(), now_s)

    def is_foreign(self, neighbour: int, now_s: float) -> bool:
        """Whether this neighbour takes no packets of this node, or this node none of its.

        A stranger can challenge in a neighbour's name, so it counts only while it goes on.
        """
        foreign_s = self._foreign_s  # mostly empty
        return bool(foreign_s) and now_s - foreign_s.get(neighbour, -math.inf) <= CHALLENGED_FOR_S

    def foreign_neighbour(self, now_s: float) -> str:
        """The latest reason given to `foreign`; empty if it is older than FOREIGN_FOR_S."""
        reason, at_s = self._foreign
        return reason if now_s - at_s <= FOREIGN_FOR_S else ""

    def own_id_heard(self, now_s: float) -> None:
        """A packet came from a radio with this node's id."""
        self.add(f"another radio uses id {self._node_id}", "give each node its own", now_s)

    def dropped(self, reason: str, payload: bytes, now_s: float) -> None:
        self.add(f"dropped {reason}", payload.hex(), now_s)
