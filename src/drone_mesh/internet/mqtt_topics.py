"""The MQTT topics and the content of their messages.

    drone_mesh/<mesh>/<node>/rx[/<port>]   a message that the gateway received from that node
    drone_mesh/<mesh>/<node>/tx[/<port>]   publish here to send a message to that node
    drone_mesh/<mesh>/<node>/state         retained: JSON, the node's state as known to the gateway
                                           `by`; it holds while that gateway is online
    drone_mesh/<mesh>/<node>/event         JSON: outcome of a message for that node ("state"), or an
                                           event of that node ("event")

`rx` and `tx` carry only the bytes of the message; port 0 has no level of its own. <node> is an id,
for `tx` also "all".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from drone_mesh.arguments import is_up_to
from drone_mesh.communication.data.outgoing import TO_ALL
from drone_mesh.communication.data.packets import MAX_DATA_PORT
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.errors import ConfigurationError

ROOT = "drone_mesh"
DEFAULT_MESH = "mesh"
PASSWORD_VARIABLE = "DRONE_MESH_MQTT_PASSWORD"  # of the environment
_PORTS = {"mqtt": 1883, "mqtts": 8883}


@dataclass(frozen=True)
class Broker:
    """The address of the broker, and the user to log in as."""

    host: str
    port: int
    tls: bool
    mesh: str  # name of the mesh, a level of the topics
    user: str = ""  # empty: none
    password: str = ""

    @property
    def url(self) -> str:
        """Address without user and password."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.tls else 'mqtt'}://{host}:{self.port}"


def parse_broker(url: str, password: str = "") -> Broker:
    """mqtt[s]://[USER@]HOST[:PORT]/[MESH]. Raises ConfigurationError."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise ConfigurationError(f"invalid MQTT address {url!r}: {error}") from error
    if parts.scheme not in _PORTS or not parts.hostname or parts.query or parts.fragment:
        raise ConfigurationError(
            f"invalid MQTT address {url!r}: use mqtt://HOST/ or mqtts://USER@HOST:PORT/MESH"
        )
    if parts.password is not None:
        raise ConfigurationError(
            "a password in the MQTT address shows in the list of processes: "
            f"use {PASSWORD_VARIABLE} in the environment, or --mqtt-password-file on a Pi"
        )
    mesh = parts.path.strip("/") or DEFAULT_MESH
    if not re.fullmatch(r"[\w.-]{1,64}", mesh):
        raise ConfigurationError(f"invalid mesh name {mesh!r}: use letters, digits, '_', '.', '-'")
    if password and not parts.username:
        raise ConfigurationError("an MQTT password needs a user: mqtt://USER@HOST/")
    return Broker(
        parts.hostname,
        port or _PORTS[parts.scheme],
        parts.scheme == "mqtts",
        mesh,
        unquote(parts.username or ""),
        password,
    )


class Destination(NamedTuple):
    """The destination that a `tx` topic names."""

    to: int
    port: int


class Topics:
    """The topics of one mesh."""

    def __init__(self, mesh: str) -> None:
        self._prefix = f"{ROOT}/{mesh}"

    def rx(self, node: int, port: int) -> str:
        """The topic for messages from `node`."""
        return f"{self._prefix}/{node}/rx" + (f"/{port}" if port else "")

    def state(self, node: int) -> str:
        """The topic for the retained state of `node`."""
        return f"{self._prefix}/{node}/state"

    @property
    def all_states(self) -> str:
        """A filter that matches every `state` topic."""
        return f"{self._prefix}/+/state"

    def node_of_state(self, topic: str) -> int | None:
        """The node whose `state` topic this is; None: it is another kind of topic."""
        node = self.node_of(topic)
        is_state = is_up_to(node, MAX_NODE_ID) and topic == self.state(int(node))
        return int(node) if is_state else None

    def event(self, node: str) -> str:
        """The topic for outcomes of messages for `node`, and for its events."""
        return f"{self._prefix}/{node}/event"

    @property
    def all_tx(self) -> list[str]:
        """Filters that match every `tx` topic."""
        return [f"{self._prefix}/+/tx", f"{self._prefix}/+/tx/+"]

    def node_of(self, topic: str) -> str:
        """The level of a topic that names the node."""
        return topic[len(self._prefix) + 1 :].partition("/")[0]

    def destination(self, topic: str) -> Destination | None:
        """The destination of a message on a `tx` topic; None if the topic is invalid."""
        node, _tx, rest = topic[len(self._prefix) + 1 :].partition("/tx")
        port = rest[1:] or "0"
        if not is_up_to(port, MAX_DATA_PORT):
            return None
        if node == "all":
            return Destination(TO_ALL, int(port))
        if not is_up_to(node, MAX_NODE_ID):
            return None
        return Destination(int(node), int(port))
