"""The Wireshark dissector, on frames of the emulated air and on payloads that a radio heard."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile

import pytest

from drone_mesh.communication.beacon.packets import Beacon, Below, Motion
from drone_mesh.communication.orders.intake import OrderOutcome, reply_packets
from drone_mesh.communication.reports import NodeReport
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import (
    GoToLocationMessage,
    HeartbeatMessage,
    IntroduceMessage,
    LocationMessage,
    with_order_number,
)
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.nrf24.emulator.frames import Frame, FrameFormat
from drone_mesh.nrf24.emulator.trace import (
    LINKTYPE_PAYLOADS,
    CapturedPacket,
    PcapngWriter,
    write_pcapng,
)
from drone_mesh.raspberry.radio_command import DISSECTOR, main

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("tshark") is None, reason="tshark is not installed: apt install tshark"
    ),
]

# Wireshark 4.4 loads no script for root.
NOBODY = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
AS_NOBODY = NOBODY if os.geteuid() == 0 else []
ADDRESS = bytes.fromhex("54 4D 52 68 0A")
ORDER = with_order_number(GoToLocationMessage(0, 3, 5, 5, 1.5, -2.0, 7).to_payload(), 258)


def shown(path, *fields):
    """The values of these fields for each packet, as tshark prints them."""
    names = [word for field in fields for word in ("-e", field)]
    with tempfile.TemporaryDirectory() as folder, path.open("rb") as packets:
        os.chmod(folder, 0o755)
        script = shutil.copy(str(DISSECTOR), folder)
        done = subprocess.run(
            [*AS_NOBODY, "tshark", "-X", f"lua_script:{script}", "-r", "-", "-T", "fields", *names],
            env={**os.environ, "HOME": folder},
            stdin=packets,
            capture_output=True,
            encoding="utf-8",
            check=True,
        )
    assert "Lua" not in done.stderr, done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


def payloads(path, *packets):
    writer = PcapngWriter(path, LINKTYPE_PAYLOADS, "test")
    for packet in packets:
        writer.write(CapturedPacket(0, packet, ""))
    writer.close()
    return path


@pytest.mark.parametrize(
    ("form", "whole"),
    [
        (FrameFormat(5, 2, True, None), ["0a", "1"]),
        (FrameFormat(5, 1, True, None), ["0a", "1"]),
        (FrameFormat(5, 2, False, 32), ["0a", ""]),
        (FrameFormat(5, 1, False, 32), ["0a", ""]),
    ],
)
def test_a_frame_on_the_air_is_taken_apart_down_to_the_order_in_it(tmp_path, form, whole):
    frame = Frame.encode(ADDRESS, ORDER, form, pid=1)
    path = tmp_path / "air.pcapng"
    write_pcapng(path, [CapturedPacket(0, frame.to_bytes(), "")])
    ((address, pid, *mesh),) = shown(
        path, "nrf24.address", "nrf24.pid", "drone_mesh.creator", "drone_mesh.from",
        "drone_mesh.type", "drone_mesh.forward", "drone_mesh.latitude", "drone_mesh.height",
        "drone_mesh.order",
    )  # fmt: skip
    assert [address[-2:], pid] == whole
    assert mesh == ["0", "3", "6", "5", "1.5", "7", "258"]


def test_an_acknowledgement_is_named(tmp_path):
    path = tmp_path / "air.pcapng"
    frame = Frame.encode(ADDRESS, b"", FrameFormat(5, 2, True, None), pid=2)
    write_pcapng(path, [CapturedPacket(0, frame.to_bytes(), "")])
    assert shown(path, "nrf24.pid", "_ws.col.Info") == [["2", "acknowledgement"]]


def test_the_fields_of_each_message_are_those_that_were_packed(tmp_path):
    report = NodeReport(3, 2, 4, Location(1.0, -2.4, 3.0), 80, True, False, 1.5)
    path = payloads(
        tmp_path / "heard.pcapng",
        LocationMessage(1, 1, 2, 2, 0.5, 2.5, -3, 77).to_payload(),
        IntroduceMessage(7, 7, 254, 254, 2, True).to_payload(),
        HeartbeatMessage(5, 6, 7, 0, True, 0, 4).to_payload(),
        *reply_packets(9, OrderOutcome.REFUSED, "too far", 5, 0),
        report.packet(6, 0),
        bytes.fromhex("00 00 44 fe fe 09 05 01").ljust(32, b"\0"),
        bytes((1, 2, 200, 3, 4)).ljust(32, b"\5"),
    )
    columns = ("type", "hops", "height", "gateway", "outcome", "text", "place", "flying", "can_fly")
    seen = shown(path, *(f"drone_mesh.{name}" for name in columns))
    yes, no = seen[4][7], seen[4][8]  # "1" and "0", or "True" and "False" in later versions
    assert yes != no
    assert seen == [
        ["1", "", "-3", "", "", "", "", "", ""],
        ["3", "2", "", "", "", "", "", "", ""],
        ["4", "4", "", "0", "", "", "", "", ""],
        ["64", "", "", "", "2", "too far", "", "", ""],
        ["66", "2", "", "", "", "", "5,-12,15", yes, no],
        ["68", "", "", "", "", "", "", "", ""],
        ["200", "", "", "", "", "", "", "", ""],
    ]
    assert shown(path, "_ws.col.Info")[1] == ["PRESENT made by 7, for 254"]
    assert shown(path, "_ws.col.Info")[5] == ["NODE_SEARCH made by 0, for 254"]
    assert shown(path, "drone_mesh.node", "drone_mesh.number")[5] == ["9", "261"]


def test_a_beacon_is_taken_apart_as_its_flags_say(tmp_path):
    place, gateway_place = Location(1.0, -2.4, 3.0), Location(0.0, 12.0, 0.0)
    motion = Motion(place, (0.0, 50.0, 0.0))
    below = Below(4, (5, 9))
    beacon = Beacon(0, 200, 2, 4, (3, 255, 255), 1.6, motion, gateway_place, 0, True, below)
    body = beacon._replace(digest=0x1234, gateway_place=None).to_body(27)
    path = payloads(
        tmp_path / "heard.pcapng",
        *(
            messages.packet(MessageType.BEACON, 6, 6, 254, 254, each)
            for each in (beacon.to_body(27), body)
        ),
    )
    columns = (
        "beacon_number", "hops", "parent", "ancestors", "interval", "beacon_place", "velocity",
        "digest", "after", "below_bytes", "below", "flying",
    )  # fmt: skip
    head = ["200", "2", "4", "03ffff", "32"]
    assert shown(path, *(f"drone_mesh.{name}" for name in columns)) == [
        [*head, "10,65512,30,0,120,0", "0,127,0", "", "4", "2", "0509", ""],
        [*head, "10,65512,30", "0,127,0", "0x1234", "4", "2", "0509", ""],
    ]


def test_what_a_radio_hears_is_in_the_file_with_the_command_that_opens_it(tmp_path, capsys):
    file = tmp_path / "heard.pcapng"
    assert main(["--emulated", "5", "listen", "--seconds", "0.2", "--pcapng", str(file)]) == 0
    assert f"wireshark -X lua_script:{DISSECTOR} {file}" in capsys.readouterr().out
    assert shown(file, "frame.number") == []
    assert main(["--emulated", "5", "listen", "--pcapng", str(tmp_path / "no" / "file")]) == 1
    assert "No such file" in capsys.readouterr().err
