"""The mesh on Raspberry Pis: one node each, with a real radio. Without ROS."""
