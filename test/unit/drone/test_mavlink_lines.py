"""The serial port of an autopilot: one program uses it, and a full one ends no program."""

from __future__ import annotations

import os
from typing import Iterator

import pytest

from drone_mesh.drone.mavlink.link import open_line
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
