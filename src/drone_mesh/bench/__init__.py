"""The benchmark command: starts the system by itself, measures it, and prints what it found."""
