"""The state of the whole mesh, for people: merged, judged, told as a table or a story. No ROS."""

from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus, Role

__all__ = ["EventRecord", "MeshStatus", "NodeStatus", "Role"]
