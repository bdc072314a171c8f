"""Beacon: one broadcast per node and period decides neighbours, connection and routes.

For drones that move (docs/beacons.md, "Beacons"). It needs no heartbeats, PRESENT and MISSING. It
may call the node's parts, and implements `IControlPlane`.
"""
