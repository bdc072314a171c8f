"""The simulated world: time, the drones' bodies and their flights. Without ROS.

The state of a world and of everything in it belongs to the one thread that calls `World.step()`.
Other threads may order a flight (`DroneEngine.set_goal`) and read snapshots (`DroneEngine.state`).
"""
