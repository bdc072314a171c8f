"""Everything that speaks ROS. The rooms around it do not know that it exists."""
