"""Routing: which neighbour leads to which node.

`routing.interfaces` is the contract of a technique; each technique decides its routes from what the
node hears, and reaches the node only through `IRoutingEssentials`.
"""
