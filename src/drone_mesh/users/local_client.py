"""LocalClient: sends a program's requests to a node of this machine; see local_socket."""

from __future__ import annotations

import base64
import contextlib
import json
import socket
from pathlib import Path
from typing import Any, Iterator

from drone_mesh.errors import MeshError

CONNECT_WITHIN_S = 5.0  # our choice


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


def _checked(line: bytes) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(line)
    if "error" in answer:
        raise Refused(str(answer["error"]))
    return answer
