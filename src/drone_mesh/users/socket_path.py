"""The paths of the local sockets of nodes."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import Mapping

SYSTEM_FOLDER = Path("/run/drone_mesh")  # of the services: RuntimeDirectory=drone_mesh


def socket_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder for the sockets of nodes that this user starts."""
    if environment.get("RUNTIME_DIRECTORY"):  # set by systemd
        return Path(environment["RUNTIME_DIRECTORY"])
    if environment.get("XDG_RUNTIME_DIR"):
        return Path(environment["XDG_RUNTIME_DIR"]) / "drone_mesh"
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
