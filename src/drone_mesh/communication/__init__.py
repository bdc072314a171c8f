"""The mesh software: no ROS, pybullet or SPI; no clock, threads or randomness of its own."""
