"""A folder for sockets of its own, and a mesh whose nodes programs reach through them."""

import pytest
from users_rig import UsersRig

from drone_mesh.users.local_client import socket_path
from drone_mesh.users.local_socket import LocalSocket


@pytest.fixture(autouse=True)
def _own_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.delenv("DRONE_MESH_NODE", raising=False)


@pytest.fixture(name="rig")
def served_rig():
    rig = UsersRig()
    served = [LocalSocket(desk, socket_path(desk.node_id)) for desk in rig.desks.values()]
    for one in served:
        one.start()
    yield rig
    for one in served:
        one.stop()
