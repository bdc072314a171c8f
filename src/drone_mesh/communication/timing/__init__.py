"""Timing: the times, rates and deadlines to which a node keeps.

Decides when something is due, and how often it may happen: the adjustable times of the protocol,
what the medium adds to them, the timers of a node, limits per period. Knows no packet.
"""
