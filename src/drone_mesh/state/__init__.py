"""The state of the whole mesh, for people: merged, judged, as a table or a story. No ROS."""
