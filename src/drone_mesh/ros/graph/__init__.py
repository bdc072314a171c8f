"""What every ROS node of the package shares: names, conversions, parameters, logs, orderly stop."""
