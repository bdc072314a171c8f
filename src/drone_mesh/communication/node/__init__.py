"""Node: one node of the mesh, a router or a gateway, put together from the rooms below.

Decides which parts a node has, and which of them handles a packet, a timer or an order. Hosts
create it with `assemble_component` and drive it from outside.
"""
