"""The drone as the mesh software sees it."""

from drone_mesh.drone.interfaces import IDroneEngine, Location

__all__ = ["IDroneEngine", "Location"]
