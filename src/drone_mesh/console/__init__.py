"""The web console: one page that shows and controls the mesh. Without ROS."""

DEFAULT_PORT = 8080  # docs/observing.md, "Web console"
