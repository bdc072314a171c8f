"""What shows the mesh to people, or watches it: console, rviz, status, report, bags."""
