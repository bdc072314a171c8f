"""What console, internet and raspberry share: access rules, the port, the server's thread. No ROS.

Nothing is imported here: access rules need no web server, and a Pi's router has none.
"""

LOOPBACK = "127.0.0.1"  # the default address of each server: only programs of this machine reach it
