"""The class names of the document of 2019 are kept."""

from __future__ import annotations

import re
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src" / "drone_mesh"

OF_THE_DOCUMENT = """
ChildTableTree DroneEngine DroneFactory DroneManager GatewayDrone GoToLocationMessage
HeartbeatMessage IDroneEngine IGatewayCommands IInternetConnection IMeshDebugInfo IMeshNetwork
IRoutingEssentials IRoutingTechnique IWirelessCommunication IntroduceMessage Location
LocationMessage MeshnetworkComponent MeshnetworkGateway MeshnetworkRouter Message MissingMessage
MovementNegotiationMessage NRF24HighLevelInterface NRF24LowLevelInterface Node
RosDroneEngineConnector RosInternetMock RouterDrone VirtualDrone VirtualNRF24
VirtualRaspberryPi VirtualRaspberryPiGateway VirtualRaspberryPiRouter WirelessSignalSimulator
"""


def test_each_class_that_the_document_of_2019_names_exists():
    text = "\n".join(path.read_text(encoding="utf-8") for path in SOURCE.rglob("*.py"))
    defined = re.findall(r"^ *class (\w+)[(:]", text, re.MULTILINE)
    assert set(OF_THE_DOCUMENT.split()) - set(defined) == set()
