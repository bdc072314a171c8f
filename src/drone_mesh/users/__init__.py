"""Access for users: how other threads and programs send and receive data through a node.

No ROS and no hardware.
"""

from drone_mesh.users.local_client import ALL, GATEWAY, Mesh, MeshMessage

__all__ = ["ALL", "GATEWAY", "Mesh", "MeshMessage"]
