"""Nodes and commands that show or observe the mesh: console, rviz, status, report, bags."""
