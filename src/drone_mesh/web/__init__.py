"""What all HTTP servers share: access, the port, the server thread. No ROS."""
