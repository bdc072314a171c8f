"""Hosts of the mesh software: each drone's virtual Raspberry Pi and its antenna."""
