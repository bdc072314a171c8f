"""The drone as the mesh software sees it."""

from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location

__all__ = ["IDroneEngine", "Location"]
