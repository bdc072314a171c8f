"""What console, internet and raspberry share: access rules, the port, the server's thread. No ROS.

Nothing is imported here: access rules need no web server, and a Pi's router has none.
"""
