"""The state of the whole mesh: merged, judged, and counted over time. No ROS."""
