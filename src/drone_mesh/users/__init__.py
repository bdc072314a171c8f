"""Access for users: how other threads and programs send and receive data through a node.

No ROS and no hardware.
"""
