"""What a simulation tells other processes about itself: its run, and its present drones.

Each world has a new run, which tells what belongs to it from what an earlier one left behind.
Topics whose messages mean nothing in another world carry it in the header of their connections,
since the definitions of their messages are fixed.
"""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Any, Collection, Mapping

from drone_mesh.drone.roles import Role

FIELD = "run"  # of the connection header

Run = str
"""The name of a run; empty: the world is of another program, which has none."""


def new_run() -> Run:
    """The name of a new run, different from all earlier ones."""
    return secrets.token_hex(8)


def run_headers(run: Run) -> dict[str, str]:
    """The connection headers of a publisher in this run."""
    return {FIELD: run} if run else {}


def run_of(message: Any) -> Run:
    """The run in which a received message was published; empty if its publisher named none."""
    return str(message._connection_header.get(FIELD, ""))


def is_left_behind(message: Any, run: Run) -> bool:
    """Whether a received message names another run. Publishers of other programs name none."""
    return run_of(message) not in ("", run)


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
        roles = {node_id: Role.GATEWAY for node_id in value["gateways"]}
        roles.update({node_id: Role.ROUTER for node_id in value["routers"]})
        hosts = dict(zip(value["added"], value["hosts"]))
        return cls({node_id: roles[node_id] for node_id in sorted(roles)}, hosts)
