"""LocalClient: a program's requests to a node of this machine; Mesh: its messages, a line each.

local_socket answers them, at the paths that are here.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import json
import os
import socket
from pathlib import Path
from typing import Any, Iterator, NamedTuple

from drone_mesh.arguments import whole
from drone_mesh.communication.data.outgoing import TO_ALL, TO_GATEWAY
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.errors import MeshError

SYSTEM_FOLDER = Path("/run/drone_mesh")  # of the services: RuntimeDirectory=drone_mesh


def socket_folder() -> Path:
    """The folder for the sockets of nodes that this user starts."""
    if os.environ.get("RUNTIME_DIRECTORY"):  # set by systemd
        return Path(os.environ["RUNTIME_DIRECTORY"])
    if os.environ.get("XDG_RUNTIME_DIR"):
        return Path(os.environ["XDG_RUNTIME_DIR"]) / "drone_mesh"
    return Path(f"/tmp/drone_mesh-{os.getuid()}")


def socket_path(node_id: int) -> Path:
    """The socket path of a node that this user starts."""
    return socket_folder() / _name(node_id)


def served_sockets() -> list[Path]:
    """The sockets of running nodes, of this user and of the services, sorted by name."""
    folders = (socket_folder(), SYSTEM_FOLDER)
    found = {path for folder in folders for path in folder.glob(_name("*"))}
    return sorted(path for path in found if is_served(path))


def is_served(path: Path) -> bool:
    """Whether a program answers at this socket; a killed one leaves its socket behind."""
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except PermissionError:
            return True  # of another user: the request will report that
        except OSError:
            return False
    return True


def node_of(path: Path) -> str:
    """The id of the node whose socket this is."""
    return path.stem[len("node-") :]


def _name(node_id: int | str) -> str:
    return f"node-{node_id}.sock"


NODE_VARIABLE = "DRONE_MESH_NODE"  # the id to use if a program does not name one
CONNECT_WITHIN_S = 5.0


class NodeUnreachable(MeshError):
    """No program answers at the socket. Start the node, or specify another socket."""


class Refused(MeshError):
    """The node refused the request; the text gives its reason."""


class LocalClient:
    """One node, through its socket. Each call opens its own connection."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def send(
        self, to: int, payload: bytes, *, port: int = 0, reliable: bool = True, wait_s: float = 0.0
    ) -> tuple[bool, str]:
        """Whether the message was delivered within `wait_s`, and its ticket as text."""
        answer = self._ask(
            {
                "do": "send",
                "to": to,
                "port": port,
                "reliable": reliable,
                "payload": base64.b64encode(payload).decode(),
                "wait": wait_s,
            },
            wait_s,
        )
        return bool(answer["arrived"]), str(answer["ticket"])

    def echo(self, to: int, wait_s: float) -> dict[str, Any]:
        """`answered`, and if so `round_trip_s`, `hops` and `route`."""
        return self._ask({"do": "echo", "to": to, "wait": wait_s}, wait_s)

    def listen(self, port: int | None = None) -> Iterator[dict[str, Any]]:
        """The messages that arrive, until the node stops; `payload` is bytes."""
        with self._connection({"do": "listen", "port": port}, None) as lines:
            for line in lines:
                answer = _checked(line)
                if "sender" in answer:
                    yield {**answer, "payload": base64.b64decode(answer["payload"])}

    def _ask(self, request: dict[str, Any], wait_s: float) -> dict[str, Any]:
        with self._connection(request, wait_s + 2 * CONNECT_WITHIN_S) as lines:
            try:
                line = next(lines, b"")
            except socket.timeout as error:
                raise NodeUnreachable(f"{self._path}: no answer in time") from error
        if not line:
            raise NodeUnreachable(f"{self._path}: the node stopped without an answer")
        return _checked(line)

    @contextlib.contextmanager
    def _connection(
        self, request: dict[str, Any], timeout_s: float | None
    ) -> Iterator[Iterator[bytes]]:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(CONNECT_WITHIN_S)
            try:
                connection.connect(str(self._path))
                connection.sendall(json.dumps(request).encode() + b"\n")
            except OSError as error:
                raise NodeUnreachable(
                    f"no node answers at {self._path} ({error.strerror or error}): is it running, "
                    "as the same user? --node and --socket choose another one"
                ) from error
            connection.settimeout(timeout_s)
            with connection.makefile("rb") as lines:
                yield lines


def node_here(chosen: int | None = None) -> LocalClient:
    """This node of this machine; None: the one in NODE_VARIABLE, or else the only one.

    Raises MeshError.
    """
    given = os.environ.get(NODE_VARIABLE, "")
    if chosen is None and given:
        try:
            chosen = whole(0, MAX_NODE_ID)(given)
        except argparse.ArgumentTypeError as error:
            raise MeshError(f"{NODE_VARIABLE}: {error}") from None
    found = served_sockets()
    if chosen is not None:
        of_chosen = [path for path in found if node_of(path) == str(chosen)]
        return LocalClient(of_chosen[0] if of_chosen else socket_path(chosen))
    if len(found) == 1:
        return LocalClient(found[0])
    if not found:
        raise MeshError(
            f"no node runs here (no socket in {socket_folder()}): start raspberry_router or "
            "raspberry_gateway (without hardware: raspberry_gateway --emulated 7)"
        )
    ids = ", ".join(node_of(path) for path in found)
    raise MeshError(f"several nodes run here ({ids}): choose one with --node")


def _checked(line: bytes) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(line)
    if "error" in answer:
        raise Refused(str(answer["error"]))
    return answer


GATEWAY, ALL = TO_GATEWAY, TO_ALL


class MeshMessage(NamedTuple):
    """A message that arrived."""

    node: int  # who sent it
    type: int  # the port of the other interfaces, 0..255
    data: bytes


class Mesh:
    """The node that runs on this machine, of raspberry_router or raspberry_gateway.

    Needs no ROS; any number of programs may use one node, also after it was started again.
    """

    def __init__(self, node: int | None = None) -> None:
        """`node`: its id; None: the only one that runs here. Raises MeshError."""
        self._node = node_here(node)

    def write(self, node: int, type: int, data: bytes, wait_s: float = 10.0) -> bool:
        """Send up to 1,024 bytes to a node, to GATEWAY or to ALL; whether they arrived in `wait_s`.

        The node keeps trying for 240 s. To ALL a message is sent once, and nobody confirms it.
        Raises MeshError if the node does not run or refuses the message.
        """
        arrived, _ticket = self._node.send(
            node, data, port=type, reliable=node != ALL, wait_s=wait_s
        )
        return arrived

    def read(self, type: int | None = None) -> Iterator[MeshMessage]:
        """The messages that arrive from now on, of one type or of all, until the node stops."""
        for message in self._node.listen(type):
            yield MeshMessage(message["sender"], message["port"], message["payload"])
