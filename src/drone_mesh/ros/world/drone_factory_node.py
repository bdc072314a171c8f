"""The node /DroneFactory: the world, the drones in it, and by default their Raspberry Pis."""

from __future__ import annotations

from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import or_exit
from drone_mesh.ros.world.factory_parameters import FactoryParameters
from drone_mesh.ros.world.simulation import RosSimulation
from drone_mesh.world.bullet_world import BulletWorld


def main() -> None:
    """Runs the world, the drones in it, and by default the nodes on the drones.

    Parameters (private): ~config (str): the configuration file, config/factory.yaml by default;
    every key of that file: a parameter with its name overrides the file; ~hosts (int, 1): with 1
    the nodes run in this process, with any other number in other processes. The program also
    checks the layout file that /DroneManager/casus names.
    """
    start_node(main.__doc__, "DroneFactory", disable_signals=True)
    show_library_logs_on_rosout()
    parameters = or_exit(FactoryParameters.read)
    with OrderlyStop() as stop, BulletWorld() as world:
        RosSimulation(parameters, world).run(stop)
