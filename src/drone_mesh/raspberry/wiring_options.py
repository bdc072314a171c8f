"""The wiring of a radio and its settings: options that the programs of a Pi share."""

from __future__ import annotations

import argparse
import contextlib
from dataclasses import dataclass

from drone_mesh.arguments import MOST, is_up_to, whole
from drone_mesh.nrf24.pins import (
    CE_GPIO,
    IRQ_GPIO,
    SPI_HZ,
    CePin,
    GpiodCe,
    GpiodIrq,
    IrqPin,
    SpiDevice,
    open_spi,
)
from drone_mesh.nrf24.settings import DATA_RATES, DEFAULT_RATE, BroadcastMode, RadioSettings

HIGHEST_GPIO = 27  # of the 40-pin header
SPI_HZ_RANGE = (10_000, 10_000_000)  # [DS 8.3.2]: 10 MHz at most
_BROADCASTS = {mode.value: mode for mode in BroadcastMode}


@dataclass(frozen=True)
class Hardware:
    """Where the radio is connected."""

    spi: tuple[int, int]  # bus, device
    ce_gpio: int
    irq_gpio: int | None  # None: the radio is polled
    spi_hz: int = SPI_HZ

    def open(self) -> tuple[SpiDevice, CePin, IrqPin | None]:
        """Open all, or raise RadioError and leave none open."""
        with contextlib.ExitStack() as opened:
            spi = open_spi(*self.spi, self.spi_hz)
            opened.callback(spi.close)
            ce = GpiodCe(self.ce_gpio)
            opened.callback(ce.close)
            irq = None if self.irq_gpio is None else GpiodIrq(self.irq_gpio)
            opened.pop_all()
        return spi, ce, irq


def add_wiring_options(parser: argparse.ArgumentParser) -> None:
    wiring = parser.add_argument_group("wiring")
    wiring.add_argument(
        "--spi",
        type=_spi_device,
        default=(0, 0),
        metavar="BUS.DEVICE",
        help="SPI device, as in /dev/spidevBUS.DEVICE (default: 0.0)",
    )
    wiring.add_argument(
        "--ce",
        type=whole(0, HIGHEST_GPIO),
        default=CE_GPIO,
        metavar="GPIO",
        help="GPIO of the CE pin (default: %(default)s, which is pin 22 of the header)",
    )
    wiring.add_argument(
        "--irq",
        type=whole(0, HIGHEST_GPIO),
        metavar="GPIO",
        help=f"GPIO of the IRQ pin, {IRQ_GPIO} for pin 18 of the header "
        "(default: not connected, the radio is polled)",
    )
    wiring.add_argument(
        "--spi-hz",
        type=whole(*SPI_HZ_RANGE),
        default=SPI_HZ,
        metavar="HZ",
        help="SPI clock; 1000000 for long wires (default: %(default)s)",
    )


def wired_hardware(parsed: argparse.Namespace) -> Hardware:
    return Hardware(parsed.spi, parsed.ce, parsed.irq, parsed.spi_hz)


def add_common_options(group: argparse._ActionsContainer) -> None:
    """Add what all radios of a mesh have in common."""
    group.add_argument(
        "--channel",
        type=whole(0, 125),
        default=RadioSettings.channel,
        help="radio channel, 0..125: 2400 + CHANNEL MHz (default: %(default)s)",
    )
    group.add_argument(
        "--rate",
        choices=DATA_RATES,
        default=DEFAULT_RATE,
        help="data rate in bits per second (default: %(default)s)",
    )
    group.add_argument(
        "--crc",
        type=int,
        choices=(8, 16),
        default=8 * RadioSettings.crc_bytes,
        help="length of the CRC in bits; 8 if a node runs the software of 2019 "
        "(default: %(default)s)",
    )
    group.add_argument(
        "--broadcast",
        choices=_BROADCASTS,
        default=BroadcastMode.NO_ACK.value,
        help="broadcast mode; shockburst if a node has a clone of the chip or a chip without '+' "
        "(default: %(default)s)",
    )


def common_settings(parsed: argparse.Namespace) -> RadioSettings:
    return RadioSettings(
        channel=parsed.channel,
        data_rate=DATA_RATES[parsed.rate],
        crc_bytes=parsed.crc // 8,
        broadcast_mode=_BROADCASTS[parsed.broadcast],
    )


def _spi_device(text: str) -> tuple[int, int]:
    bus, dot, device = text.partition(".")
    if not (dot and is_up_to(bus, MOST) and is_up_to(device, MOST)):
        raise argparse.ArgumentTypeError(
            f"invalid SPI device {text!r}: must be BUS.DEVICE, as in 0.0"
        )
    return int(bus), int(device)
