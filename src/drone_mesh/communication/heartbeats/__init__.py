"""Heartbeats: the document's way to find neighbours, gateways and routes.

It decides by PRESENT, HEARTBEAT and MISSING packets; one of the routing techniques of `routing`
chooses the next hops. It may call `routing` and the node's parts, and implements `IControlPlane`.
"""
