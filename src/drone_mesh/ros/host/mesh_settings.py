"""MeshSettings: the settings that all nodes of a simulation share."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.node.node_configuration import NodeConfiguration
from drone_mesh.communication.seals.keys import MeshKey, read_key_file
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.internet.mqtt_topics import PASSWORD_VARIABLE, Broker, parse_broker
from drone_mesh.ros.graph.run import Run


@dataclass(frozen=True)
class MeshSettings:
    """Settings of every node of a simulation: the configuration, with the objects that it names."""

    configuration: FactoryConfiguration
    run: Run
    node: NodeConfiguration
    obstacles: Obstacles | None
    broker: Broker  # with "mqtt"
    key: MeshKey | None  # None: packets are not sealed

    @classmethod
    def from_configuration(
        cls, configuration: FactoryConfiguration, run: Run, obstacles: Obstacles | None = None
    ) -> MeshSettings:
        """The settings of this configuration, in this run. Raises ConfigurationError.

        `obstacles`: nodes refuse orders to places that these make unreachable.
        """
        return cls(
            configuration,
            run,
            configuration.node,
            obstacles=obstacles,
            key=_mesh_key(configuration.key),
            broker=parse_broker(configuration.broker, os.environ.get(PASSWORD_VARIABLE, "")),
        )


def _mesh_key(file: str) -> MeshKey | None:
    if not file:
        return None
    with naming_argument("key: ", file):
        keys = read_key_file(Path(file))
        if not isinstance(keys, MeshKey):
            raise ConfigurationError(f"{file}: holds the keys of one node; expected a mesh key")
    return keys
