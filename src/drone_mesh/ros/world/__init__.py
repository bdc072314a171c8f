"""The node /DroneFactory: the world, its time, and the state of the whole mesh."""
