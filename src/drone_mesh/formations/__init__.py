"""Formations: flights of a fleet by plan, and which drones of it may set out when. Without ROS."""
