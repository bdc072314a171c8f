"""Reports: what each node tells its gateway about itself from time to time.

Decides when a node reports and which reports a gateway keeps. Reads a node's snapshots and sends
through its delivery; nothing in the mesh depends on a report.
"""
