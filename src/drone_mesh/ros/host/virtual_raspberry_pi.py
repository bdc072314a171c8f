"""VirtualRaspberryPi, a simulated drone's computer, and the settings that all of them share.

docs/ros.md, "Virtual Raspberry Pi".
"""

from __future__ import annotations

import abc
import os
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, ClassVar

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.events.observer import MeshObserver, Observers
from drone_mesh.communication.interfaces import IInternetConnection, IWirelessCommunication
from drone_mesh.communication.node.assembly import Security, assemble_node
from drone_mesh.communication.node.node_configuration import NodeConfiguration
from drone_mesh.communication.seals.keys import MeshKey, read_key_file
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.execution import ExecutorSlot
from drone_mesh.internet import DEFAULT_PORT
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.internet.mqtt_topics import PASSWORD_VARIABLE, Broker, parse_broker
from drone_mesh.internet.on_demand import SeveralInternets, http_internet, mqtt_internet
from drone_mesh.ros.graph.simulation import Run
from drone_mesh.ros.host.engines import RosDroneEngineConnector, SilentEngines
from drone_mesh.ros.host.node_access import RosInternetMock, UsersOfNode
from drone_mesh.users.desk import UsersDesk


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


class VirtualRaspberryPi(abc.ABC):
    """Routing technique, engine connector, antenna, and the mesh component built from them.

    For the executor's worker only: create, start and stop it there.
    """

    role: ClassVar[Role]

    def __init__(
        self,
        node_id: int,
        settings: MeshSettings,
        observer: MeshObserver,
        antenna: IWirelessCommunication,
        slot: ExecutorSlot,
        why_not_fly: Callable[[], str],
        silent: SilentEngines,
    ) -> None:
        """`why_not_fly` and `silent` as for RosDroneEngineConnector.

        Raises ConfigurationError for a routing technique that does not exist."""
        self.node_id = node_id
        self.engine = RosDroneEngineConnector(
            node_id, settings.run, why_not_fly, silent, settings.obstacles
        )
        self.slot = slot
        self.users = UsersDesk(node_id, slot.submit)
        self._users_of_node = UsersOfNode(self.users)
        self._observers = Observers(observer)
        security = None
        if settings.key is not None:
            security = Security(settings.key, lambda: self.component.deadlines.now_s)
        self.component, _receiver = assemble_node(
            node_id,
            antenna,
            self.engine,
            random.Random(f"{settings.configuration.seed}/{node_id}"),
            settings.node,
            internet=self._make_internet(settings),
            security=security,
            observer=self._observers,
            debug=settings.configuration.debug,
        )

    def start(self, now_s: float) -> None:
        self.engine.connect()
        self.users.open(self.component.data)
        self._users_of_node.start(self.component.data)
        self.component.start(now_s)
        self.slot.drive(self.component)

    def keep_to(self, obstacles: Obstacles, now_s: float) -> None:
        """These boxes and this fence hold from now on."""
        self.engine.keep_to(obstacles)
        self.component.on_fence(now_s)

    def stop(self, _now_s: float) -> None:
        self._users_of_node.stop()
        self.component.stop()
        self.engine.disconnect()

    @abc.abstractmethod
    def _make_internet(self, settings: MeshSettings) -> IInternetConnection | None:
        """A gateway's internet side; None for a router."""


class VirtualRaspberryPiRouter(VirtualRaspberryPi):
    """Runs a router."""

    role = Role.ROUTER

    def _make_internet(self, _settings: MeshSettings) -> None:
        return None


class VirtualRaspberryPiGateway(VirtualRaspberryPi):
    """Runs a gateway."""

    role = Role.GATEWAY

    def _make_internet(self, settings: MeshSettings) -> IInternetConnection:
        mock = RosInternetMock(self.node_id, self.slot)
        internet = settings.configuration.internet
        if internet == "mock":
            return mock
        if internet == "mqtt":
            # Only one gateway forwards what is published; several would send it several times.
            sends = self.node_id == 0
            mqtt = mqtt_internet(self.slot.submit, self.users, settings.broker, sends=sends)
            self._observers.add(mqtt.observe)
            return SeveralInternets(mock, mqtt)
        http = http_internet(
            self.slot.request, HttpSettings(port=DEFAULT_PORT + self.node_id), users=self.users
        )
        return SeveralInternets(mock, http)


VIRTUAL_RASPBERRY_PIS = {
    kind.role: kind for kind in (VirtualRaspberryPiGateway, VirtualRaspberryPiRouter)
}
