"""The web console: one page that shows the mesh and acts on it. No ROS in here."""
