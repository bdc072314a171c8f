"""What the factory tells the hosts of nodes, in its own process and in others."""

from __future__ import annotations

import dataclasses

import rospy

from drone_mesh.communication.observer import ignore_events
from drone_mesh.communication.routing import create_routing_technique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.ros.graph import names
from drone_mesh.ros.host.virtual_raspberry_pi import MeshSettings


def mesh_settings(configuration: FactoryConfiguration) -> MeshSettings:
    """What the nodes have to know of the configuration. Raises ConfigurationError."""
    create_routing_technique(configuration.routing)  # complain now, and not in each node
    return MeshSettings(
        gateways=configuration.gateways,
        routing=configuration.routing,
        timing=MeshTiming(configuration.check_period, configuration.connection_lost_after),
        seed=configuration.seed,
        debug=configuration.debug,
        observer=ignore_events,
        internet=configuration.internet,
    )


def tell_hosts(configuration: FactoryConfiguration) -> None:
    """Let hosts in other processes know which drones there are, and how their nodes are set."""
    fleet = dataclasses.asdict(configuration)
    fleet["seed"] = str(configuration.seed)  # XML-RPC has no integers above 2**31
    rospy.set_param(names.FLEET_PARAM, fleet)


def fleet_from_parameter() -> FactoryConfiguration:
    """What tell_hosts told. Raises KeyError while there is nothing."""
    fleet = rospy.get_param(names.FLEET_PARAM)
    return FactoryConfiguration(**{**fleet, "seed": int(fleet["seed"])})
