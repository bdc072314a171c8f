"""A mesh of drones: the mesh software, its radio, and a world to try both in."""
