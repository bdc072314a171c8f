"""The web console: one page that shows and controls the mesh. Without ROS."""
