"""Neighbours: what a node knows of the nodes around it.

Decides who is a neighbour, where nodes were last heard, which of them move by themselves, and whose
coordinates have the same origin. The other parts of a node report here what they learn.
"""
