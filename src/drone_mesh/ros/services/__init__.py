"""The nodes /WirelessSignalSimulator and /DroneManager."""
