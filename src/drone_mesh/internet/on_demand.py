"""Imports the HTTP and MQTT libraries only when a gateway needs them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drone_mesh.communication.interfaces import IInternetConnection
from drone_mesh.errors import ConfigurationError

if TYPE_CHECKING:
    from drone_mesh.internet.asking import Submit
    from drone_mesh.internet.http_settings import HttpSettings
    from drone_mesh.internet.mqtt_internet import MqttInternet
    from drone_mesh.internet.mqtt_topics import Broker
    from drone_mesh.internet.status import ReadStatus, StatusServer
    from drone_mesh.users.desk import UsersDesk


def http_internet(submit: Submit, http: HttpSettings, **settings: Any) -> IInternetConnection:
    """Create an HttpInternet. Also raises ConfigurationError if its libraries are missing."""
    try:  # they take a second to load
        from drone_mesh.internet.http_internet import HttpInternet
    except ImportError as error:
        raise ConfigurationError(
            f"orders over HTTP need the Python package {error.name}: pip install 'drone_mesh[http]'"
        ) from error
    return HttpInternet(submit, http, **settings)


def mqtt_internet(
    submit: Submit, users: UsersDesk, broker: Broker, **settings: Any
) -> MqttInternet:
    """Create an MqttInternet. Also raises ConfigurationError if its library is missing."""
    try:
        from drone_mesh.internet.mqtt_internet import MqttInternet
    except ImportError as error:
        raise ConfigurationError(
            f"MQTT needs the Python package {error.name}: pip install 'drone_mesh[mqtt]'"
        ) from error
    return MqttInternet(submit, users, broker, **settings)


def status_server(status: ReadStatus, http: HttpSettings) -> StatusServer:
    """Create a StatusServer. Also raises ConfigurationError if its libraries are missing."""
    try:
        from drone_mesh.internet.status import StatusServer
    except ImportError as error:
        raise ConfigurationError(
            f"--http needs the Python package {error.name}: pip install 'drone_mesh[http]'"
        ) from error
    return StatusServer(status, http)
