"""LocalSocket: gives other programs of this machine access to a node, over a UNIX socket.

One request per connection, a line of JSON; the answer is one or more lines:

    {"do": "send", "to": 5, "port": 0, "reliable": true, "payload": BASE64, "wait": SECONDS}
    {"do": "listen", "port": 0 or null}       one line per message, until the client disconnects
    {"do": "echo", "to": 5, "wait": SECONDS}

A refusal is {"error": reason}. Only the user that runs the node can open the socket.
"""

from __future__ import annotations

import base64
import contextlib
import json
import logging
import os
import select
import socket
import socketserver
import stat
import threading
from pathlib import Path
from typing import Any, Mapping

from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.errors import ConfigurationError, MessageRefused
from drone_mesh.users.desk import Sending, UsersDesk, check_wait, in_json
from drone_mesh.users.local_client import is_served

MOST_REQUEST_BYTES = 4096  # a message of 1,024 bytes in base64 takes 1,400
MOST_CLIENTS = 32
REQUEST_WITHIN_S = 5.0
_POLL_S = 0.1  # how soon a listener's thread notices the end of the node

_log = logging.getLogger(__name__)


class LocalSocket:
    """Serves one node's desk. `start` and `stop` are for the thread that owns this object.

    Threads: one that accepts, and one per client, all ended by `stop`.
    """

    def __init__(self, desk: UsersDesk, path: Path) -> None:
        """Create the socket. Raises ConfigurationError if that is not possible."""
        _prepare(path)
        self.path = path
        try:
            self._server = _Server(str(path), desk)
        except OSError as error:
            raise ConfigurationError(f"socket {path}: {error.strerror or error}") from error
        path.chmod(0o600)
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(_POLL_S,), name=f"users of {desk.node_id}"
        )

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Close all connections; returns when the threads have ended."""
        self._server.stopping = True
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
        self._server.server_close()
        # It may be gone, or the folder be another user's now; what is left is taken for unserved.
        with contextlib.suppress(OSError):
            self.path.unlink()


def warn_of_unreachable(reasons: Mapping[int, str]) -> None:
    """Log one line about the nodes of this program that have no socket; `reasons` by node.

    The commands are a convenience: a node works without them.
    """
    if reasons:
        nodes = ids_in_words(sorted(reasons))
        _log.warning(
            "mesh_ping, mesh_send and the other commands cannot reach node%s %s: %s",
            "s" * (len(reasons) > 1),
            nodes,
            reasons[min(reasons)],
        )


class _Server(socketserver.ThreadingUnixStreamServer):
    daemon_threads = False
    block_on_close = True
    request_queue_size = MOST_CLIENTS

    def __init__(self, path: str, desk: UsersDesk) -> None:
        self.desk = desk
        self.stopping = False
        self.clients = threading.BoundedSemaphore(MOST_CLIENTS)
        super().__init__(path, _Client)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignored: clients may disconnect at any time."""


_INVALID = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError)


class _Client(socketserver.StreamRequestHandler):
    server: _Server
    timeout = REQUEST_WITHIN_S

    def handle(self) -> None:
        if not self.server.clients.acquire(blocking=False):
            self._say({"error": f"{MOST_CLIENTS} programs use this node already"})
            return
        try:
            self._answer(json.loads(self.rfile.readline(MOST_REQUEST_BYTES)))
        except _INVALID as error:
            self._say({"error": f"invalid request: {error}"})
        except MessageRefused as error:
            self._say({"error": str(error)})
        except OSError:
            pass  # the client disconnected
        finally:
            self.server.clients.release()

    def _answer(self, request: dict[str, Any]) -> None:
        what, desk = request["do"], self.server.desk
        if what == "send":
            payload = base64.b64decode(request["payload"], validate=True)
            wait_s = float(request.get("wait", 0.0))
            check_wait(wait_s)
            sending = desk.send(
                int(request["to"]),
                payload,
                int(request.get("port", 0)),
                bool(request.get("reliable", True)),
            )
            arrived = self._wait(sending, wait_s)
            self._say({"arrived": arrived, "ticket": sending.in_words(wait_s)})
        elif what == "echo":
            wait_s = float(request.get("wait", 5.0))
            answer = desk.echo(int(request["to"]), wait_s, lambda: self.server.stopping)
            if answer is None:
                self._say({"answered": False})
            else:
                self._say(
                    {
                        "answered": True,
                        "round_trip_s": answer.round_trip_s,
                        "hops": answer.hops,
                        "route": list(answer.route),
                    }
                )
        elif what == "listen":
            port = request.get("port")
            self._listen(None if port is None else int(port))
        else:
            raise ValueError(f"unknown request: {what}")

    def _wait(self, sending: Sending, seconds: float) -> bool:
        """Wait for the delivery in short steps, so that the end of the node ends the wait."""
        if seconds <= 0:
            return sending.wait(0.0)
        while seconds > 0 and not self.server.stopping:
            if sending.wait(min(seconds, _POLL_S)):
                return True
            if sending.over.done():
                break
            seconds -= _POLL_S
        return False

    def _listen(self, port: int | None) -> None:
        node = self.server.desk.node_id
        listener = self.server.desk.listen(port)
        warned = False
        try:
            self._say({"listening": node})
            while not (self.server.stopping or self._is_gone()):
                message = listener.next(_POLL_S)
                if message is not None:
                    self._write(in_json(message))
                if listener.dropped and not warned:
                    warned = True
                    _log.warning("node %d: a listener reads too slowly and loses messages", node)
        except socket.timeout:  # after half a line, so nothing more can be told
            text = "node %d: disconnects a listener that read nothing for %g s"
            _log.warning(text, node, REQUEST_WITHIN_S)
        finally:
            listener.close()
            if warned:
                _log.warning("node %d: that listener lost %d messages", node, listener.dropped)

    def _is_gone(self) -> bool:
        readable, _, _ = select.select([self.request], [], [], 0.0)
        return bool(readable) and not self.request.recv(1, socket.MSG_PEEK)

    def _say(self, answer: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):
            self._write(answer)

    def _write(self, answer: dict[str, Any]) -> None:
        self.wfile.write(json.dumps(answer).encode() + b"\n")


def _prepare(path: Path) -> None:
    """Create the folder, for this user only; remove a socket that no program serves any more."""
    folder = path.parent
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"socket {path}: {error.strerror}: {folder}") from error
    if folder.stat().st_uid != os.getuid():
        raise ConfigurationError(f"socket {path}: {folder} belongs to another user")
    if not path.exists():
        return
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise ConfigurationError(f"socket {path}: a file with this name already exists")
    if is_served(path):
        raise ConfigurationError(f"socket {path}: another program already runs a node with this id")
    path.unlink()
