"""The parameters by which the factory describes its fleet to other processes.

/drone_mesh/fleet: the configuration that the factory was started with.
/drone_mesh/drones: the present drones (PresentDrones.to_parameter).
"""

from __future__ import annotations

import dataclasses

import rospy

from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.simulation import PresentDrones

__all__ = ["drones_if_known"]  # for users; see docs/architecture.md


def set_fleet_parameter(configuration: FactoryConfiguration) -> None:
    """Publish the settings of the nodes to hosts in other processes."""
    fleet = dataclasses.asdict(configuration)
    fleet["seed"] = str(configuration.seed)  # XML-RPC has no integers above 2**31
    rospy.set_param(names.FLEET_PARAM, fleet)


def get_fleet_parameter() -> FactoryConfiguration:
    """The configuration that the factory has set. Raises KeyError before it has."""
    fleet = rospy.get_param(names.FLEET_PARAM)
    return FactoryConfiguration(**{**fleet, "seed": int(fleet["seed"])})


def get_present_drones() -> PresentDrones:
    """The present drones. Raises KeyError before the factory has created any."""
    return PresentDrones.from_parameter(rospy.get_param(names.DRONES_PARAM))


def drones_if_known() -> PresentDrones | None:
    """The present drones; None if there is no factory, or it has not created any yet."""
    try:
        return get_present_drones()
    except KeyError:
        return None
