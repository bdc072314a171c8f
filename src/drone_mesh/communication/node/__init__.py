"""Node: one node of the mesh, a router or a gateway, put together from the rooms below.

Decides which parts a router and a gateway have; each declares the packets and timers that it
handles. Hosts create a node with `assemble_node` and drive it from outside.
"""
