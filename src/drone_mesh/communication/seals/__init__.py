"""Seals: keys, and the tags by which a node knows that a packet is genuine and new.

Decides which packets of a keyed mesh are accepted. Imports the packets and the interfaces of the
mesh; nothing else in the mesh imports it: a `SealedAntenna` lies between a node and its antenna.
"""
