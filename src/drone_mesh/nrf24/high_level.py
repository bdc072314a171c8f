"""NRF24HighLevelInterface: the antenna of the mesh on an nRF24L01+ (docs/radio.md)."""

from __future__ import annotations

from drone_mesh.channel.antenna import PacketAntenna


class NRF24HighLevelInterface(PacketAntenna):
    """The antenna of the mesh on a NRF24LowLevelInterface, which drives the radio."""
