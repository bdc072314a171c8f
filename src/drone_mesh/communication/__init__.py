"""The mesh software: no ROS, no pybullet, no SPI, no clock, no threads, no randomness of its own."""
