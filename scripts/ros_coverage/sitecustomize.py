"""Python imports this at its start: `scripts/test rostest --coverage` puts its folder in PYTHONPATH."""

try:
    import coverage
except ModuleNotFoundError:  # ROS's own programs run outside of the virtual environment
    pass
else:
    coverage.process_startup()
