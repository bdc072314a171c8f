"""One HTML page about a recorded run. Without ROS: states and events are plain records."""
