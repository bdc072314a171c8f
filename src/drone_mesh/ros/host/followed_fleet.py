"""FollowedFleet: starts and ends nodes of a host as drones are added and removed."""

from __future__ import annotations

import logging
from typing import Collection

import rospy

from drone_mesh.drone.roles import Role
from drone_mesh.ros.graph.fleet_parameter import get_present_drones
from drone_mesh.ros.graph.master_watch import NO_ANSWER
from drone_mesh.ros.host.mesh_host import MeshHost

_log = logging.getLogger(__name__)


class FollowedFleet:
    """Keeps a host's nodes equal to its share of /drone_mesh/drones. One thread."""

    def __init__(self, host: MeshHost, share: Collection[int]) -> None:
        """`share`: ids of the drones that this host runs unless another host does."""
        self._host = host
        self._share = share
        self._served: dict[int, Role] = {}

    def follow(self) -> None:
        """Read the parameter once; start and end the nodes that differ."""
        try:
            wanted = get_present_drones().of_host(rospy.get_name(), self._share)
        except (KeyError, *NO_ANSWER) as error:  # the master is ending or has just started
            _log.debug("the drones are not known: %s", error)
            return
        for node_id in self._served.keys() - wanted.keys():
            self._host.end_node(node_id)
        self._host.start_nodes({n: role for n, role in wanted.items() if n not in self._served})
        self._served = wanted
