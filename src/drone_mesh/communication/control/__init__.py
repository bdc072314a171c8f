"""Control: the seam between the parts of a node and what decides its connection and its routes.

Decides the states of a router, what a control plane must do (`IControlPlane`; `heartbeats` and
`beacon` implement it), what the parts of a node may ask of it, and how a part declares what it
handles (`node_part`).
"""
