"""The parameter /drone_mesh/fleet: how the factory configures hosts in other processes."""

from __future__ import annotations

import dataclasses

import rospy

from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.ros.graph import names


def set_fleet_parameter(configuration: FactoryConfiguration) -> None:
    """Publish the drones and the settings of their nodes to hosts in other processes."""
    fleet = dataclasses.asdict(configuration)
    fleet["seed"] = str(configuration.seed)  # XML-RPC has no integers above 2**31
    rospy.set_param(names.FLEET_PARAM, fleet)


def get_fleet_parameter() -> FactoryConfiguration:
    """The configuration that the factory has set. Raises KeyError before it has."""
    fleet = rospy.get_param(names.FLEET_PARAM)
    return FactoryConfiguration(**{**fleet, "seed": int(fleet["seed"])})


def fleet_if_known() -> FactoryConfiguration | None:
    """The configuration that the factory has set; None: there is no factory, or not yet."""
    try:
        return get_fleet_parameter()
    except KeyError:
        return None
