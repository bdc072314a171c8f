"""The mesh software: no ROS, no pybullet, no SPI; no clock, threads or chance of its own."""
