"""The mesh on Raspberry Pis: one node for each, with a real radio. No ROS in here."""
