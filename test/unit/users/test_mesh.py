"""Mesh, and the examples for a Pi that use it."""

from __future__ import annotations

import builtins
import runpy
import threading
import time
from pathlib import Path

import pytest

from drone_mesh.errors import MeshError
from drone_mesh.users import ALL, GATEWAY, Mesh, MeshMessage

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def listens_at(desk):
    while not desk._receivers:
        time.sleep(0.01)


def test_what_one_program_writes_another_reads(rig):
    arrived = []
    reader = threading.Thread(target=lambda: arrived.append(next(Mesh(0).read(7))))
    reader.start()
    listens_at(rig.desks[0])
    assert Mesh(2).write(0, 7, b"\x00\xff")
    reader.join(10.0)
    assert arrived == [MeshMessage(2, 7, b"\x00\xff")]


def test_a_message_to_all_is_sent_once(rig):
    assert Mesh(1).write(ALL, 3, b"hello")
    assert [(m.port, m.reliable) for m in rig.network.received[2]] == [(3, False)]


def test_without_a_node_the_error_says_what_to_start(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(MeshError, match="no node runs here"):
        Mesh()


def test_the_sender_sends_the_temperature_to_the_gateway(rig, monkeypatch):
    monkeypatch.setenv("DRONE_MESH_NODE", "2")
    monkeypatch.setattr(Path, "read_text", lambda _path: "47123\n")

    def no_second_time(seconds):
        raise StopIteration(seconds)

    monkeypatch.setattr(time, "sleep", no_second_time)
    with pytest.raises(StopIteration, match="10"):
        runpy.run_path(str(EXAMPLES / "pi_sender.py"))
    assert [(m.port, m.payload) for m in rig.network.received[0]] == [(1, b"47.1")]


def test_the_receiver_prints_who_measured_what(rig, monkeypatch):
    monkeypatch.setenv("DRONE_MESH_NODE", "0")
    printed = []
    monkeypatch.setattr(builtins, "print", lambda text, flush: printed.append(text))
    source = str(EXAMPLES / "pi_receiver.py")
    threading.Thread(target=runpy.run_path, args=(source,), daemon=True).start()
    listens_at(rig.desks[0])
    assert Mesh(2).write(GATEWAY, 1, b"47.1")
    while not printed:
        time.sleep(0.01)
    assert printed[0].endswith(" node 2: 47.1")
