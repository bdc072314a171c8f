"""A mesh of drones: the mesh software, its radio, and a simulated world for both."""
