"""The node /DroneFactory: the world, its clock, and the state of the whole mesh."""
