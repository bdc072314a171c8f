"""An nRF24L01+ and the air between several of them, in software.

An emulated chip has the interface of a real one: an SPI device with `xfer2`, a CE pin and an IRQ
pin. Any driver that accepts these runs on it.
"""

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import IdealDisc, LogDistance
from drone_mesh.nrf24.emulator.trace import FrameTrace

__all__ = [
    "Air",
    "EmulatedChip",
    "FrameTrace",
    "IdealDisc",
    "LogDistance",
    "WallClock",
]
