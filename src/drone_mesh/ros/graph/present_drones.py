"""PresentDrones: the drones of a simulation, including those added or removed at run time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Collection, Mapping

from drone_mesh.drone.roles import Role


@dataclass(frozen=True)
class PresentDrones:
    """The drones that are in the world now, and which processes run the nodes of new ones."""

    roles: Mapping[int, Role]  # by id, ascending
    hosts: Mapping[int, str]  # of drones added at run time: the ROS node of each; empty: none

    @property
    def gateways(self) -> list[int]:
        """Ids, ascending."""
        return [node_id for node_id, role in self.roles.items() if role is Role.GATEWAY]

    def of_host(self, host: str, share: Collection[int]) -> dict[int, Role]:
        """The drones whose nodes this host runs.

        `share`: the drones that it runs unless another host runs them.
        """
        return {
            node_id: role
            for node_id, role in self.roles.items()
            if (self.hosts.get(node_id) or (host if node_id in share else "")) == host
        }

    def to_parameter(self) -> dict[str, list[Any]]:
        """As a ROS parameter: ids by role, and two parallel lists for the hosts."""
        gateways = self.gateways
        return {
            "gateways": gateways,
            "routers": [node_id for node_id in self.roles if node_id not in gateways],
            "added": list(self.hosts),
            "hosts": list(self.hosts.values()),
        }

    @classmethod
    def from_parameter(cls, value: Mapping[str, Any]) -> PresentDrones:
        """Parse the result of `to_parameter`."""
        roles = {node_id: Role.GATEWAY for node_id in value["gateways"]}
        roles.update({node_id: Role.ROUTER for node_id in value["routers"]})
        hosts = dict(zip(value["added"], value["hosts"]))
        return cls({node_id: roles[node_id] for node_id in sorted(roles)}, hosts)
