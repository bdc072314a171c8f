"""Lines to an autopilot: one program uses a port, and no fault of a line ends a program."""

from __future__ import annotations

import os
import socket
import termios
from typing import Iterator

import pytest

from drone_mesh.drone.mavlink.link import MavlinkLink, open_line
from drone_mesh.errors import ConfigurationError


@pytest.fixture
def port() -> Iterator[str]:
    """A serial port whose other end nobody reads."""
    ours, theirs = os.openpty()
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def test_a_second_program_on_the_port_is_refused_and_the_first_keeps_it(port: str) -> None:
    line = open_line(f"{port},57600")
    with pytest.raises(OSError, match="^another program uses the port; is a node running?"):
        open_line(f"{port},57600")
    line.send(b"still open")
    line.close()
    open_line(f"{port},57600").close()


def test_a_port_that_takes_no_more_bytes_is_broken_and_nobody_waits_for_it(port: str) -> None:
    line = open_line(f"{port},57600")
    with pytest.raises(OSError, match="Write timeout"):
        line.send(bytes(1_000_000))
    line.close()


@pytest.mark.parametrize("baud", ["0", "-1", "1_0", "4000001", "99999999999", "fast"])
def test_a_baud_rate_that_no_port_has_is_refused(port: str, baud: str) -> None:
    with pytest.raises(ConfigurationError, match="^invalid MAVLink address"):
        open_line(f"{port},{baud}")


def test_a_port_that_vanishes_while_it_is_opened_is_one_that_is_not_there(
    port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unplugged(_fd: int, _queue: int) -> None:
        raise termios.error(5, "Input/output error")  # which is no OSError (pyserial#417)

    monkeypatch.setattr(termios, "tcflush", unplugged)
    with pytest.raises(OSError, match="Input/output error"):
        open_line(f"{port},57600")
    with pytest.raises(ConfigurationError, match="Input/output error"):
        MavlinkLink(f"{port},57600")


def test_after_a_silence_the_peer_is_where_its_name_leads_now(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    vehicle.bind(("127.0.0.2", 0))
    vehicle.settimeout(5.0)
    line = open_line(f"udpout:localhost:{vehicle.getsockname()[1]}")
    monkeypatch.setattr(socket, "gethostbyname", lambda _name: "127.0.0.2")
    line.forget_peer()
    line.send(b"heartbeat")
    assert vehicle.recvfrom(100)[0] == b"heartbeat"
    line.close()
    vehicle.close()


def test_in_flight_no_name_server_is_asked_for_the_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    vehicle.bind(("127.0.0.1", 0))
    vehicle.settimeout(5.0)
    stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line = open_line(f"udpout:localhost:{vehicle.getsockname()[1]}")

    def unreachable(_name: str) -> str:
        raise socket.gaierror(socket.EAI_AGAIN, "Temporary failure in name resolution")

    monkeypatch.setattr(socket, "gethostbyname", unreachable)
    line.send(b"heartbeat")
    data, node = vehicle.recvfrom(100)
    assert data == b"heartbeat"
    stranger.sendto(b"nonsense", node)
    assert line.receive(5.0) == b""
    vehicle.sendto(b"position", node)
    assert line.receive(5.0) == b"position"
    line.forget_peer()  # after a silence
    line.send(b"heartbeat")
    assert vehicle.recvfrom(100)[0] == b"heartbeat"
    line.close()
    vehicle.close()
    stranger.close()
