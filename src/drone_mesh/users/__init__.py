"""What serves the network user: the ways to a node's data from other threads and programs.

No ROS and no hardware. A node's own threads are not needed to import it.
"""
