"""What the mesh software knows of the drone that carries it."""

from drone_mesh.drone.interfaces import IDroneEngine, Location

__all__ = ["IDroneEngine", "Location"]
