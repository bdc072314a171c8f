"""Orders: flights that a gateway orders, and what becomes of them.

Decides whether an order is new, when it is repeated and how it ended. The gateway has the book,
each drone the intake; both only know the packets and the node's parts.
"""
