"""The commands, as programs of the same machine use a node."""

from __future__ import annotations

import io
import json
import os
import re
import socket
import sys
import threading
import time
from pathlib import Path

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.users import commands, local_socket
from drone_mesh.users.local_client import LocalClient, is_served, socket_path
from drone_mesh.users.local_socket import LocalSocket, warn_of_unreachable


def test_ping_prints_hops_time_and_loss(rig, capsys):
    assert commands.ping(["--node", "0", "-c", "2", "-i", "0", "2"]) == 0
    assert capsys.readouterr().out == (
        "node 2: number 1, 2 hops, 8.0 ms\n"
        "node 2: number 2, 2 hops, 8.0 ms\n"
        "2 sent, 2 answered, 0 % lost; round trip min/mean/max 8.0/8.0/8.0 ms\n"
    )


def test_ping_of_a_node_without_a_route_reports_it(rig, capsys):
    assert commands.ping(["--node", "0", "-c", "1", "77"]) == 1
    assert capsys.readouterr().out == (
        "node 77: number 1: no route to node 77\n1 sent, 0 answered, 100 % lost\n"
    )


def test_trace_names_the_nodes_on_the_route(rig, capsys):
    assert commands.trace(["--node", "0", "2"]) == 0
    assert capsys.readouterr().out == ("  1  node 1\n  2  node 2\nround trip: 8.0 ms\n")


@pytest.mark.parametrize("to", ["gateway", "0"])
def test_send_reports_that_the_message_arrived(rig, capsys, to):
    assert commands.send(["--node", "2", to, "21.5 degrees"]) == 0
    assert "delivered" in capsys.readouterr().out
    assert commands.send(["--socket", str(socket_path(2)), to, "22 degrees"]) == 0
    said = [message.payload for message in rig.network.received[0]]
    assert said == [b"21.5 degrees", b"22 degrees"]


def test_send_takes_an_argument_that_is_no_text_as_the_bytes_that_it_is(rig):
    assert commands.send(["--node", "2", "0", os.fsdecode(b"\xff\xfe")]) == 0
    assert [message.payload for message in rig.network.received[0]] == [b"\xff\xfe"]


def test_send_takes_any_bytes_from_standard_input(rig, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"\x00\xff")))
    assert commands.send(["--node", "2", "--no-ack", "--port", "9", "1"]) == 0
    (message,) = rig.network.received[1]
    assert (message.payload, message.port, message.reliable) == (b"\x00\xff", 9, False)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--node", "2", "0", "x" * 1025], "too large: 1025 bytes"),
        (["--node", "0", "--wait", "0.01", "--no-ack", "77", "x"], "no route to node 77"),
        (
            ["--node", "0", "--wait", "0.01", "77", "x"],
            "queued: no route to node 77; not delivered within 0.01 s, the node keeps trying",
        ),
        (["0", "x"], "several nodes run here (0, 1, 2): choose one with --node"),
        (["--node", "9", "0", "x"], "no node answers at"),
    ],
)
def test_an_error_about_a_message_is_one_line(rig, capsys, arguments, reason):
    assert commands.send(arguments) == 1
    said = capsys.readouterr()
    assert reason in said.out + said.err
    assert (said.out + said.err).count("\n") == 1


def test_a_ping_with_a_size_times_messages_of_that_size(rig, capsys):
    assert commands.ping(["--node", "2", "-c", "1", "-s", "200", "0"]) == 0
    said = capsys.readouterr().out
    assert re.match(r"node 0: number 1, 200 bytes, [\d.]+ ms\n1 sent, 1 answered, 0 % lost; ", said)
    (message,) = rig.network.received[0]
    assert (len(message.payload), message.port) == (200, 255)


def test_listen_prints_what_arrives_as_text_or_as_json(rig, capsys):
    lines = []
    for options in ([], ["--json"]):
        listening = threading.Thread(
            target=commands.listen, args=([*options, "--node", "0", "-c", "1"],)
        )
        listening.start()
        while not rig.desks[0]._receivers:
            listening.join(0.01)
        rig.desks[1].send(0, b"one", port=3)
        listening.join(10.0)
        assert not listening.is_alive()
        lines.append(capsys.readouterr().out)
        while rig.desks[0]._receivers:
            listening.join(0.01)
    assert lines[0] == "node 1 port 3: one\n"
    assert json.loads(lines[1])["payload"] == "b25l"  # "one" in base64


def test_without_a_node_the_command_says_what_to_start(capsys):
    assert commands.trace(["3"]) == 1
    assert "no node runs here" in capsys.readouterr().err


def test_a_killed_node_is_not_offered(rig, capsys):
    for left in (4, 5):
        with socket.socket(socket.AF_UNIX) as dead:
            dead.bind(str(socket_path(left)))
    assert commands.trace(["3"]) == 1
    assert "several nodes run here (0, 1, 2): choose one" in capsys.readouterr().err


def test_a_ping_that_was_never_sent_is_not_counted(capsys):
    assert commands.ping(["3"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1


def test_a_message_far_too_large_is_named_as_that(rig, capsys):
    assert commands.send(["--node", "2", "0", "x" * 9000]) == 1
    assert "too large: 9000 bytes" in capsys.readouterr().err


def test_an_invalid_receiver_is_named_with_all_valid_ones(capsys):
    with pytest.raises(SystemExit):
        commands.send(["banana", "21.5"])
    assert (
        "invalid value 'banana': must be a whole number 0..253, gateway or all"
        in capsys.readouterr().err
    )


def test_an_invalid_node_in_the_environment_gives_one_line(monkeypatch, capsys):
    monkeypatch.setenv("DRONE_MESH_NODE", "five")
    assert commands.trace(["3"]) == 1
    assert capsys.readouterr().err == (
        "mesh_trace: DRONE_MESH_NODE: invalid value 'five': must be a whole number 0..253\n"
    )


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["1_0"], "invalid value '1_0': must be a whole number 0..253"),
        (["٣"], "invalid value '٣': must be a whole number 0..253"),
        (["3", "-c", "0"], "invalid value '0': must be a whole number 1..1000000000"),
        (["3", "-i", "1_0"], "invalid value '1_0': must be a number 0..86400"),
        (["3", "-W", "nan"], "invalid value 'nan': must be a number 0..86400"),
    ],
)
def test_invalid_numbers_are_refused(capsys, arguments, reason):
    with pytest.raises(SystemExit):
        commands.ping(arguments)
    assert reason in capsys.readouterr().err


def test_only_the_user_of_the_node_may_open_its_socket(rig):
    assert socket_path(0).stat().st_mode & 0o777 == 0o600
    assert socket_path(0).parent.stat().st_mode & 0o777 == 0o700


def test_two_programs_cannot_serve_the_same_node(rig):
    with pytest.raises(
        ConfigurationError, match="another program already runs a node with this id"
    ):
        LocalSocket(rig.desks[0], socket_path(0))


def test_one_line_names_all_nodes_that_the_commands_cannot_reach(caplog):
    warn_of_unreachable({})
    assert caplog.messages == []
    warn_of_unreachable({2: "socket two", 0: "socket zero", 1: "socket one"})
    warn_of_unreachable({4: "socket four"})
    what = "mesh_ping, mesh_send and the other commands cannot reach"
    assert caplog.messages == [f"{what} nodes 0..2: socket zero", f"{what} node 4: socket four"]


def test_a_node_ends_also_if_its_socket_cannot_be_removed(rig, tmp_path, monkeypatch):
    """As if systemd has given the folder to the service of a second node on this Pi."""

    def refuse(_path):
        raise PermissionError(13, "Permission denied")

    served = LocalSocket(rig.desks[0], tmp_path / "node-9.sock")
    served.start()
    monkeypatch.setattr(Path, "unlink", refuse)
    served.stop()
    assert not is_served(tmp_path / "node-9.sock")


def test_a_socket_that_a_dead_program_left_is_replaced(rig, tmp_path):
    path = tmp_path / "left.sock"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    again = LocalSocket(rig.desks[0], path)
    again.start()
    assert LocalClient(path).echo(1, 1.0)["hops"] == 1
    again.stop()
    assert not path.exists()


@pytest.mark.parametrize(
    "request_line",
    [
        b"\n",
        b"{}\n",
        b"[1]\n",
        b'{"do": "fly"}\n',
        b"\xff\n",
        b"[" * 4000 + b"\n",
        b'{"do": "echo", "to": 1e999}\n',
        b'{"do": "listen", "port": "seven"}\n',
    ],
)
def test_an_invalid_request_is_answered(rig, request_line):
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(socket_path(0)))
        client.sendall(request_line)
        with client.makefile() as lines:
            assert "invalid request" in json.loads(lines.readline())["error"]


@pytest.mark.parametrize("wait", [b"null", b'"soon"', b"NaN", b"Infinity", b"-1", b"301"])
def test_a_message_with_an_invalid_wait_is_not_sent(rig, wait):
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(socket_path(1)))
        client.sendall(b'{"do": "send", "to": 0, "payload": "", "wait": ' + wait + b"}\n")
        with client.makefile() as lines:
            assert "invalid" in json.loads(lines.readline())["error"]
    assert rig.network.received == {}


def test_nobody_waits_for_a_message_that_was_given_up(rig):
    started_s = time.monotonic()
    arrived, words = LocalClient(socket_path(0)).send(77, b"", reliable=False, wait_s=60.0)
    assert (arrived, "no route to node 77" in words) == (False, True)
    assert time.monotonic() - started_s < 30.0


def test_a_listener_that_does_not_read_is_disconnected_with_a_line_in_the_log(
    rig, monkeypatch, caplog
):
    monkeypatch.setattr(local_socket._Client, "timeout", 0.2)
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(socket_path(0)))
        client.sendall(b'{"do": "listen"}\n')
        with client.makefile("rb") as lines:
            assert json.loads(lines.readline()) == {"listening": 0}
            for _ in range(400):
                rig.desks[0].send(0, bytes(1024))
                time.sleep(0.001)
            complete = [line for line in lines if line.endswith(b"\n")]
    assert 0 < len(complete) < 400
    assert "node 0: disconnects a listener that read nothing for 5 s" in caplog.messages
