"""The connections of a gateway: imported only when it needs them; several as one."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any, Iterator

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.errors import ConfigurationError

if TYPE_CHECKING:
    from drone_mesh.execution import Submit
    from drone_mesh.internet.guarded_app import ReadStatus, StatusServer
    from drone_mesh.internet.http_settings import HttpSettings
    from drone_mesh.internet.mqtt_internet import MqttInternet
    from drone_mesh.internet.mqtt_topics import Broker
    from drone_mesh.users.desk import UsersDesk


@contextlib.contextmanager
def _extra(extra: str, needs: str) -> Iterator[None]:
    """Around an import. Raises ConfigurationError if a package of this extra is missing."""
    try:
        yield
    except ImportError as error:
        package = f"the Python package {error.name}: pip install 'drone_mesh[{extra}]'"
        raise ConfigurationError(f"{needs} {package}") from error


def http_internet(submit: Submit, http: HttpSettings, **settings: Any) -> IInternetConnection:
    """Create an HttpInternet. Also raises ConfigurationError if its libraries are missing."""
    with _extra("http", "orders over HTTP need"):  # they take a second to load
        from drone_mesh.internet.http_internet import HttpInternet
    return HttpInternet(submit, http, **settings)


def mqtt_internet(
    submit: Submit, users: UsersDesk, broker: Broker, **settings: Any
) -> MqttInternet:
    """Create an MqttInternet. Also raises ConfigurationError if its library is missing."""
    with _extra("mqtt", "MQTT needs"):
        from drone_mesh.internet.mqtt_internet import MqttInternet
    return MqttInternet(submit, users, broker, **settings)


def status_server(status: ReadStatus, http: HttpSettings) -> StatusServer:
    """Create a StatusServer. Also raises ConfigurationError if its libraries are missing."""
    with _extra("http", "--http needs"):
        from drone_mesh.internet.guarded_app import StatusServer
    return StatusServer(status, http)


class SeveralInternets(IInternetConnection):
    """Connects and disconnects all its connections."""

    def __init__(self, *connections: IInternetConnection) -> None:
        self._connections = connections

    def connect(self, commands: IGatewayCommands) -> None:
        for connection in self._connections:
            connection.connect(commands)

    def disconnect(self) -> None:
        for connection in self._connections:
            connection.disconnect()
