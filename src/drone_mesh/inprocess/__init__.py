"""A whole mesh in one process, under a virtual clock, without ROS."""

from drone_mesh.inprocess.network import Network
from drone_mesh.state.model import MeshStatus
from drone_mesh.state.outages import find_outages, take_sample

__all__ = ["MeshStatus", "Network", "find_outages", "take_sample"]
