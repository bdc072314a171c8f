"""One declaration per packet type, and everything that follows from it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rig import Rig

from drone_mesh.communication import reports
from drone_mesh.communication.beacon.plane import BeaconTechnique
from drone_mesh.communication.control.node_part import receivers
from drone_mesh.communication.orders import intake
from drone_mesh.communication.wire import messages, packet_types
from drone_mesh.communication.wire.packet_types import ABOUT, Handler, MessageType

ROOT = Path(__file__).resolve().parents[4]
FORMS = {"bool": "?", "uint8": "B", "int16": "h", "uint16": "H", "uint32": "I", "float32": "f"}
OF_MODULES = {
    name: made_of
    for module in (messages, intake, reports)
    for name, made_of in vars(module).items()
    if isinstance(made_of, type) and hasattr(made_of, "BODY")
}


def struct_format(body):
    """How the struct module writes a declared body."""
    forms = [field.split()[0] for field in body.split(", ")]
    arrays = [re.fullmatch(r"bytes\[(\d+)\]", form) for form in forms]
    return "<" + "".join(
        f"{array[1]}s" if array else FORMS[form] for form, array in zip(forms, arrays)
    )


@pytest.mark.parametrize("made_of", OF_MODULES.values(), ids=OF_MODULES)
def test_the_declared_body_is_that_of_the_class(made_of):
    declared = made_of.TYPE.about
    assert declared.made_of == made_of.__name__
    assert struct_format(declared.body) == made_of.BODY.format


def handled(**how):
    """The types that a node declares a method for."""
    return set(receivers(Rig(**how).mesh._parts))


OF_ROUTER, OF_GATEWAY = handled(), handled(gateway=True)
WITH_BEACONS = handled(routing=BeaconTechnique())


@pytest.mark.parametrize("kind", MessageType, ids=lambda kind: kind.name)
def test_who_handles_a_type_declares_a_method_for_it(kind):
    handles = {kind in OF_ROUTER, kind in OF_GATEWAY}
    if kind.about.handler is Handler.NODE:
        assert handles == {True}
    elif kind.about.handler is Handler.ROUTER:
        assert (kind in OF_ROUTER, kind in OF_GATEWAY) == (True, False)
    elif kind.about.handler is Handler.GATEWAY:
        assert (kind in OF_ROUTER, kind in OF_GATEWAY) == (False, True)
    elif kind.about.handler is Handler.CONTROL:
        # With a key, beacons need heartbeats for the nonces of the seals.
        assert handles == {kind is MessageType.HEARTBEAT or kind not in WITH_BEACONS}
        assert kind in WITH_BEACONS or handles == {True}
    elif kind.about.handler is Handler.NOBODY:
        assert handles == {False}


def test_data_and_the_types_of_techniques_have_handlers_and_other_numbers_none():
    for number in range(256):
        has_one = ABOUT[number].handler not in (Handler.NOBODY, Handler.SEAL)
        if number not in set(MessageType):
            assert (number in OF_ROUTER, number in OF_GATEWAY) == (has_one, has_one)


def test_the_page_and_the_dissector_have_the_declared_types():
    check = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "packet_tables"), "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == 0, check.stderr


WIND = """
    WIND = 99, PacketType(PacketKind.REPORT, _NODE, "float32 latitude, uint8 gust", "WindMessage")
"""
FOUND = """
from rig import Rig
from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.lab.metrics import METRICS
from drone_mesh.raspberry.radio_tests import decoded
from drone_mesh.state.packets import kind_of

print(MessageType.WIND.about.made_of, kind_of(99).value, "own_wind" in METRICS)
print(decoded(bytes((1, 1, 99, 2, 2)).ljust(32, bytes(1))))

class Sock:
    @receives(MessageType.WIND)
    def on_wind(self, payload, creator, from_):
        print("blows", creator, from_, payload[9])

rig = Rig()
rig.mesh._parts.append(Sock())
rig.mesh.start(0.0)
rig.mesh.on_msg(bytes.fromhex("00 00 03 01 fe 00 01").ljust(32, bytes(1)), 0.0)
rig.mesh.on_msg(bytes.fromhex("05 00 63 01 01 00 00 80 3f 07").ljust(32, bytes(1)), 0.0)
rig.mesh.on_msg(bytes.fromhex("05 00 63 01 01 00 00 80 7f 08").ljust(32, bytes(1)), 0.0)
rig.mesh.on_msg(bytes.fromhex("00 00 03 01 fe 00 01").ljust(30, bytes(1)) + b"12", 0.0)
rig.mesh.on_msg(bytes.fromhex("05 00 63 01 01 00 00 80 3f 09").ljust(32, bytes(1)), 0.0)
"""


def test_a_type_that_is_added_is_found_everywhere(tmp_path):
    """A line in a copy of the package, and a method: checks, page, dots, lab, docs, dissector."""
    for folder in ("src", "scripts"):
        shutil.copytree(
            ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    (tmp_path / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "wire.md", tmp_path / "docs")
    declared = tmp_path / "src" / Path(packet_types.__file__).relative_to(ROOT / "src")
    text = declared.read_text(encoding="utf-8")
    before = "    # Where a gateway was"
    assert text.count(before) == 1
    declared.write_text(text.replace(before, WIND + before), encoding="utf-8")

    def run(*command):
        done = subprocess.run(
            [sys.executable, *map(str, command)],
            capture_output=True,
            text=True,
            check=False,
            env={"PYTHONPATH": f"{tmp_path / 'src'}:{Path(__file__).parents[1]}"},
        )
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    found, dropped = run("-c", FOUND)
    assert found.splitlines() == [
        "WindMessage report True",
        "WIND made by 1, from 1 to 2, for 2",
        "blows 5 0 7",
    ]
    assert "dropped a packet with a number that is not finite: 0500630101" in dropped
    assert "dropped a place from a node with another or an unknown origin: 0500630101" in dropped
    run(tmp_path / "scripts" / "packet_tables")
    page = (tmp_path / "docs" / "wire.md").read_text(encoding="utf-8")
    row = "| 99 | WIND | `WindMessage` | float32 latitude, uint8 gust | every node |"
    assert row in page.splitlines()
    dissector = tmp_path / "src" / "drone_mesh" / "raspberry" / "drone_mesh.lua"
    for entry in ('[99] = "WIND"', '{ "gust", "uint8", 1 }'):
        assert entry in dissector.read_text(encoding="utf-8")
