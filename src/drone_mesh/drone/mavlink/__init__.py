"""A drone with a MAVLink autopilot (ArduPilot Copter or PX4) as the engine of a node.

`MavlinkEngine` (engine) owns the link and a thread. Below it nothing has a thread, a clock or a
socket: `MavlinkPilot` (pilot) is driven with messages and ticks, so the same code runs in tests
under a virtual clock.
"""
