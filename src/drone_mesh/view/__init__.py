"""Pictures of the mesh in its world: window, snapshots, palette. No ROS."""
