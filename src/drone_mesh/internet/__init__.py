"""A gateway's connection to the outside world over HTTP, for real and for simulated gateways.

No ROS and no hardware. Nothing is imported here: a gateway without HTTP loads no web server.
"""

DEFAULT_PORT = 9080  # docs/raspberry-pi.md, "HTTP"
