"""The benchmark command: starts the system, measures it and prints the figures."""
