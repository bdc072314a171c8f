"""A class name of src/ means one thing, and those of the document of 2019 are kept."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src" / "drone_mesh"

# Two models of one thing, each with the reason why it has two classes.
SAME_IDEA = {
    "Transmission": "a frame on the air: of bits and bytes among emulated chips (nrf24.emulator), "
    "of a fate alone in the fast model of the same air (inprocess)",
}

OF_THE_DOCUMENT = """
ChildTableTree DroneEngine DroneFactory DroneManager GatewayDrone GoToLocationMessage
HeartbeatMessage IDroneEngine IGatewayCommands IInternetConnection IMeshDebugInfo IMeshNetwork
IRoutingEssentials IRoutingTechnique IWirelessCommunication IntroduceMessage Location
LocationMessage MeshnetworkComponent MeshnetworkGateway MeshnetworkRouter Message MissingMessage
MovementNegotiationMessage NRF24HighLevelInterface NRF24LowLevelInterface Node
RosDroneEngineConnector RosInternetMock RouterDrone VirtualDrone VirtualNRF24
VirtualRaspberryPi VirtualRaspberryPiGateway VirtualRaspberryPiRouter WirelessSignalSimulator
"""


def files_by_class():
    files = defaultdict(set)
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for name in re.findall(r"^ *class (\w+)[(:]", text, re.MULTILINE):
            files[name].add(str(path.relative_to(SOURCE)))
    return files


def test_no_two_files_define_classes_of_one_name_for_different_ideas():
    shared = {name: sorted(files) for name, files in files_by_class().items() if len(files) > 1}
    assert shared.keys() - SAME_IDEA.keys() == set(), shared


def test_each_exception_is_needed():
    files = files_by_class()
    assert {name for name in SAME_IDEA if len(files[name]) < 2} == set()


def test_each_class_that_the_document_of_2019_names_exists():
    assert set(OF_THE_DOCUMENT.split()) - files_by_class().keys() == set()
