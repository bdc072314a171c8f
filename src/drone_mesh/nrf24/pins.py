"""SPI, CE and IRQ of a radio: what a driver needs, and those on the header of a Raspberry Pi.

SPI goes through spidev, the pins through gpiod 2 (the bindings of libgpiod). The GPIO chip is found
by its label, because its number differs between models and kernels.
"""

from __future__ import annotations

import time
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, Sequence

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


CE_GPIO = 25  # pin 22 of the header (docs/radio.md, "Wiring and settings")
IRQ_GPIO = 24  # pin 18
HEADER_LABELS = ("pinctrl-bcm2835", "pinctrl-bcm2711", "pinctrl-rp1")  # up to Pi 3, Pi 4, Pi 5
_CONSUMER = "drone_mesh nRF24L01+"


class CePin(Protocol):
    """Chip enable, an output."""

    value: bool

    def close(self) -> None:
        """Release the pin."""


class IrqPin(Protocol):
    """Interrupt request, an input, low while a flag of the chip is set. One thread waits for it."""

    def wait_low(self, timeout_s: float) -> bool:
        """Wait until it is low; returns False if it is still high after the time-out."""

    def close(self) -> None:
        """Release the pin."""


def _gpiod() -> ModuleType:
    try:
        import gpiod
    except ImportError as error:
        raise HardwareUnavailable(
            "the Python package gpiod is missing (for the CE pin): pip install 'gpiod>=2'"
        ) from error
    module: ModuleType = gpiod
    if not hasattr(module, "request_lines"):
        raise HardwareUnavailable(
            "the installed gpiod is older than version 2, which has another interface "
            "(as in Debian 12): pip install 'gpiod>=2' in a virtual environment"
        )
    return module


def find_header(devices: Path = Path("/dev")) -> str:
    """Path of the GPIO chip with the header's pins."""
    gpiod = _gpiod()
    refused = False
    labels = []
    for path in sorted(devices.glob("gpiochip*")):
        try:
            with gpiod.Chip(str(path)) as chip:
                label = chip.get_info().label
        except PermissionError:
            refused = True
            continue
        except OSError:
            continue
        if label in HEADER_LABELS:
            return str(path)
        labels.append(label)
    if refused:
        raise HardwareUnavailable(
            "no permission to open /dev/gpiochip*: sudo usermod -aG gpio $USER, and log in again"
        )
    raise HardwareUnavailable(
        f"no GPIO chip of a Raspberry Pi found (looked for {', '.join(HEADER_LABELS)} in "
        f"{devices}/gpiochip*, found {', '.join(labels) or 'none'}): is this a Raspberry Pi?"
    )


def _request(gpio: int, **settings: Any) -> Any:
    gpiod = _gpiod()
    path = find_header()
    try:
        config = {gpio: gpiod.LineSettings(**settings)}
        return gpiod.request_lines(path, consumer=_CONSUMER, config=config)
    except OSError as error:
        raise HardwareUnavailable(
            f"cannot use GPIO{gpio} of {path}: {error.strerror or error} "
            "(is another program using it?)"
        ) from error


class GpiodCe:
    """CE on a pin of the header; low initially and after `close`."""

    def __init__(self, gpio: int = CE_GPIO) -> None:
        line = _gpiod().line
        self._gpio, self._line = gpio, line
        self._lines = _request(
            gpio, direction=line.Direction.OUTPUT, output_value=line.Value.INACTIVE
        )
        self._value = False

    @property
    def value(self) -> bool:
        return self._value

    @value.setter
    def value(self, high: bool) -> None:
        level = self._line.Value.ACTIVE if high else self._line.Value.INACTIVE
        self._lines.set_value(self._gpio, level)
        self._value = high

    def close(self) -> None:
        """Set it low and release it."""
        self.value = False
        self._lines.release()


class GpiodIrq:
    """IRQ on a pin of the header. Levels decide and edges only wake, so none can be missed."""

    def __init__(self, gpio: int = IRQ_GPIO) -> None:
        line = _gpiod().line
        self._gpio, self._low = gpio, line.Value.INACTIVE
        self._lines = _request(
            gpio,
            direction=line.Direction.INPUT,
            edge_detection=line.Edge.FALLING,
            bias=line.Bias.PULL_UP,
        )

    def wait_low(self, timeout_s: float) -> bool:
        """See IrqPin."""
        until_s = time.monotonic() + timeout_s
        while self._lines.get_value(self._gpio) != self._low:
            left_s = until_s - time.monotonic()
            if left_s <= 0:
                return False
            if self._lines.wait_edge_events(left_s):
                self._lines.read_edge_events()  # it may be an old edge, so check again
        return True

    def close(self) -> None:
        """Release the pin."""
        self._lines.release()
