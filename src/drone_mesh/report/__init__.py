"""One HTML page about a recorded run. No ROS: states and events come in as plain records."""
