"""A whole mesh in one process, under a virtual clock, without ROS."""

from drone_mesh.inprocess.network import Network

__all__ = ["Network"]
