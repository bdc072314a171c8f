"""Hosts of the mesh software: the virtual Raspberry Pi and the antenna of each drone."""
