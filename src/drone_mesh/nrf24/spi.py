"""The SPI device of a Raspberry Pi, through spidev."""

from __future__ import annotations

from typing import Protocol, Sequence

from drone_mesh.nrf24.errors import HardwareUnavailable

SPI_HZ = 8_000_000  # [DS 8.3.2] allows 10 MHz at 5 pF, 8 MHz at 10 pF


class SpiDevice(Protocol):
    """The part of spidev.SpiDev that the driver uses."""

    def xfer2(self, data: Sequence[int]) -> list[int]:
        """Clock out `data` with CSN low throughout; return the bytes received."""

    def close(self) -> None:
        """Release the device."""


def open_spi(bus: int = 0, device: int = 0, hz: int = SPI_HZ) -> SpiDevice:
    """Open /dev/spidev<bus>.<device>. HardwareUnavailable: what is missing, and the remedy."""
    path = f"/dev/spidev{bus}.{device}"
    try:
        import spidev
    except ImportError as error:
        raise HardwareUnavailable(
            f"cannot use {path}: the Python package spidev is missing "
            "(sudo apt install python3-spidev, or pip install spidev)"
        ) from error
    spi = spidev.SpiDev()
    try:
        spi.open(bus, device)
    except FileNotFoundError as error:
        raise HardwareUnavailable(
            f"{path} does not exist: switch SPI on with sudo raspi-config (Interface Options), "
            "or dtparam=spi=on in /boot/firmware/config.txt, and restart"
        ) from error
    except PermissionError as error:
        raise HardwareUnavailable(
            f"no permission to open {path}: sudo usermod -aG spi $USER, and log in again"
        ) from error
    except OSError as error:
        raise HardwareUnavailable(f"cannot open {path}: {error.strerror or error}") from error
    spi.mode = 0
    spi.max_speed_hz = hz
    opened: SpiDevice = spi
    return opened
