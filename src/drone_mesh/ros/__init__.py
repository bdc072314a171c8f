"""The ROS side: nodes, hosts, services and views. No other package imports it."""

import threading

# rospy 1.15.9 (Debian 11) calls isAlive when it shuts down; Python 3.9 no longer has it.
if not hasattr(threading.Thread, "isAlive"):
    threading.Thread.isAlive = threading.Thread.is_alive  # type: ignore[attr-defined]
