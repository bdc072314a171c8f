"""The state of the whole mesh: merged, assessed, and counted over time. Without ROS."""
