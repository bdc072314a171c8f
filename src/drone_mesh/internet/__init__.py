"""A gateway's way to the world outside over HTTP, for real and for simulated gateways alike.

Nothing in here knows of ROS or of a Raspberry Pi.
"""

from drone_mesh.internet.http_internet import HttpInternet

__all__ = ["HttpInternet"]
