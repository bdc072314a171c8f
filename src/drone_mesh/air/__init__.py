"""The simulated medium: which antenna is where, and which antennas hear each other."""
