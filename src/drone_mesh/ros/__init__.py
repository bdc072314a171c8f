"""The ROS side: nodes, hosts, services and views. No other package imports it."""
