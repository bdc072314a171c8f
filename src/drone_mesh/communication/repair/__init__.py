"""Repair: what a router does when it has lost its gateway for too long.

Decides who flies, where to, and when a flight is over. Calls the router's connection, its places
and its pilot; only the router calls it. The strategies see no more than `RepairActions`.
"""
