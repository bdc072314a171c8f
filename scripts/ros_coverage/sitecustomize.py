"""Python imports this at its start, with `scripts/test rostest --coverage`."""

try:
    import coverage
except ModuleNotFoundError:  # ROS's own programs run outside of the virtual environment
    pass
else:
    coverage.process_startup()
