"""Names of the figures in /diagnostics that add up over processes: the bench reads them."""

from __future__ import annotations

DELIVERED = "delivered"  # packets handed to a node, each receiver of a broadcast counted
LOST_IN_RANGE = "lost in range"  # packets for a node that is on, in range and has listened before
WORST_LAG = "worst timer lag"  # s, simulated: how late the latest timer was since the last report
