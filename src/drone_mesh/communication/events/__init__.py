"""Events: what a node tells to those who watch it.

Decides what is an event, with which fields, and how often the log complains of what was dropped.
Every part of a node may report; hosts, views and the lab read.
"""
