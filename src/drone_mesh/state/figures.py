"""Names of the figures that processes publish in /diagnostics."""

from __future__ import annotations

DELIVERED = "delivered"  # packets handed to a node, counting each receiver of a broadcast
LOST_IN_RANGE = "lost in range"  # packets for a node that is on, in range and has listened before
WORST_LAG = "worst timer lag"  # s, simulated: the longest delay of a timer since the last report
