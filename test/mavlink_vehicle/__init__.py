"""A simulated MAVLink vehicle: an autopilot and its drone, for tests and demonstrations.

`MavlinkVehicle` (vehicle) is driven with messages and ticks; `VehicleServer` (server) runs several
over UDP, for engines and ground stations.
"""
