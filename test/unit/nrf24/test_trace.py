"""The trace of the air, and its file."""

from __future__ import annotations

import shutil
import struct
import subprocess

import pytest
from chip_lab import PAYLOAD

from drone_mesh.nrf24.emulator.trace import FrameTrace


def blocks(data):
    """Type and body of each pcapng block."""
    while data:
        kind, length = struct.unpack_from("<II", data)
        assert struct.unpack_from("<I", data, length - 4) == (length,)
        assert length % 4 == 0
        yield kind, data[8 : length - 4]
        data = data[length:]


@pytest.fixture
def traffic(lab):
    one, _other = lab.driver(5), lab.driver(10, 100.0)
    one.send(10, PAYLOAD)
    one.broadcast(PAYLOAD)
    return lab


def test_a_frame_is_traced_with_its_bits_and_its_times(traffic):
    data, answer, broadcast = traffic.trace.frames
    assert (data.end_ns - data.start_ns, answer.end_ns - answer.start_ns) == (1_316_000, 292_000)
    assert (data.sender, answer.sender, broadcast.sender) == ("node 5", "node 10", "node 5")
    assert (data.is_answer, answer.is_answer) == (False, True)
    assert data.listeners == ("node 10",)
    # preamble, address 54 4D 52 68 0A, PCF: length 110011, PID 01, ask for an answer
    assert data.frame.to_bytes()[:7] == bytes.fromhex("55 54 4D 52 68 0A CD")
    assert answer.frame.to_bytes()[:7] == bytes.fromhex("55 54 4D 52 68 0A CD")
    assert broadcast.frame.to_bytes()[:7] == bytes.fromhex("55 54 4D 52 68 FE CE")
    assert broadcast.frame.to_bytes()[7] & 0x80  # NO_ACK
    assert "frame from node 5, 321 bits after the preamble" in str(data)


def test_the_trace_forgets_the_oldest_beyond_its_limit(lab):
    short = FrameTrace(limit=2)
    lab.air.observe(short.see)
    one = lab.driver(5)
    for number in range(3):
        one.broadcast(bytes((number,)) * 32)
    assert short.frames == lab.trace.frames[-2:]


def test_the_file_is_pcapng_with_nanoseconds_and_a_comment_for_each_frame(traffic, tmp_path):
    path = tmp_path / "air.pcapng"
    assert traffic.trace.write(path) == 3
    section, interface, *packets = blocks(path.read_bytes())
    assert section[0] == 0x0A0D0D0A
    assert struct.unpack_from("<I", section[1]) == (0x1A2B3C4D,)
    assert interface[0] == 1
    assert struct.unpack_from("<H", interface[1]) == (147,)
    assert b"\x09\x00\x01\x00\x09" in interface[1]  # if_tsresol 10^-9
    assert [kind for kind, _body in packets] == [6, 6, 6]
    _number, high, low, captured, length = struct.unpack_from("<IIIII", packets[0][1])
    first = traffic.trace.frames[0]
    assert high << 32 | low == first.start_ns
    assert captured == length == len(first.frame.to_bytes())
    assert packets[0][1][20 : 20 + captured] == first.frame.to_bytes()
    assert b"frame from node 5" in packets[0][1]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_opens_the_file(traffic, tmp_path):
    path = tmp_path / "air.pcapng"
    traffic.trace.write(path)
    shown = subprocess.run(
        ["tshark", "-r", str(path), "-T", "fields", "-e", "frame.len", "-e", "frame.comment"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    lines = shown.splitlines()
    assert [line.split("\t")[0] for line in lines] == ["42", "10", "42"]
    assert "acknowledgement from node 10" in lines[1]


def test_a_file_that_cannot_be_written_is_an_os_error(traffic, tmp_path):
    with pytest.raises(FileNotFoundError):
        traffic.trace.write(tmp_path / "missing" / "air.pcapng")
