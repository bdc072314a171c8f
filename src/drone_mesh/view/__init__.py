"""Views of the mesh: palette, table, window and snapshots of the world. Without ROS."""
