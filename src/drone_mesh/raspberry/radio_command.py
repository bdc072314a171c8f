"""The program raspberry_radio: field tools for one radio, real or emulated."""

from __future__ import annotations

import argparse
import contextlib
import math
import platform
import random
import sys
import time
from pathlib import Path
from typing import Callable, Iterator, Sequence

from drone_mesh.arguments import MOST, decimal, whole
from drone_mesh.channel.runtime import Runtime, SystemRuntime
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.trace import LINKTYPE_PAYLOADS, CapturedPacket, PcapngWriter
from drone_mesh.nrf24.pins import CePin, IrqPin, SpiDevice
from drone_mesh.nrf24.settings import DATA_RATES, RadioSettings
from drone_mesh.raspberry import radio_tests, range_test
from drone_mesh.raspberry.field_radio import FieldRadio
from drone_mesh.raspberry.node_reports import version
from drone_mesh.raspberry.wiring_options import (
    add_common_options,
    add_wiring_options,
    common_settings,
    wired_hardware,
)
from drone_mesh.stopping import ends_as

REPORT_ROUNDS = 20
PARTNER_ID = 1  # with an emulated radio
FARTHEST_M = 100_000.0  # no radio reaches further
USUAL_NODES = 17  # the field case
DISSECTOR = Path(__file__).with_name("drone_mesh.lua")


@ends_as("raspberry_radio")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one tool; the exit status is 0, 1 if the radio failed, 2 for a wrong option."""
    options = _parser().parse_args(arguments)
    has_failed = False
    try:
        with _opened(options) as (radio, irq):
            for line in _tool(options, radio, irq):
                print(line, flush=True)
                has_failed |= line.startswith("FAIL")
    except MeshError as error:
        print(f"FAIL {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(file=sys.stderr)
    return int(has_failed)


def _tool(options: argparse.Namespace, radio: FieldRadio, irq: IrqPin | None) -> Iterator[str]:
    if options.tool == "check":
        return radio_tests.check(radio, irq)
    if options.tool == "scan":
        return radio_tests.scan(radio, options.rounds, options.nodes)
    if options.tool == "range":
        rates = tuple(DATA_RATES.values()) if options.all_rates else ()
        return range_test.measure_range(radio, options.to, options.packets, options.distance, rates)
    if options.tool == "answer":
        return range_test.answer(radio, lambda: False)
    if options.tool == "listen":
        until_s = time.monotonic() + options.seconds
        return _listen(radio, lambda: time.monotonic() >= until_s, options.pcapng)
    return _report(radio, irq, options)


def _listen(radio: FieldRadio, ended: Callable[[], bool], file: Path | None) -> Iterator[str]:
    if file is None:
        yield from radio_tests.listen(radio, ended)
        return
    try:
        writer = PcapngWriter(file, LINKTYPE_PAYLOADS, "nRF24L01+")
    except OSError as error:
        raise ConfigurationError(f"--pcapng {file}: {error.strerror or error}") from error
    with contextlib.closing(writer):
        yield f"for Wireshark: wireshark -X lua_script:{DISSECTOR} {file}"
        yield from radio_tests.listen(
            radio, ended, lambda payload: writer.write(CapturedPacket(time.time_ns(), payload, ""))
        )


def _report(radio: FieldRadio, irq: IrqPin | None, options: argparse.Namespace) -> Iterator[str]:
    """Write the output of check and scan, and a description of this machine, to one file."""
    file: Path = options.file
    lines = [
        f"drone_mesh {version()}",
        f"time {time.strftime('%Y-%m-%d %H:%M:%S %z')}",
        f"machine {_model()}, {platform.platform()}, Python {platform.python_version()}",
        f"radio {_radio_in_words(options)}",
        f"settings {radio.settings}",
    ]
    # Before the scan, which takes seconds; an earlier report stays until this one is complete.
    with _refusing(file):
        file.open("a", encoding="utf-8").close()
    try:
        lines.append("== check")
        for line in radio_tests.check(radio, irq):
            lines.append(line)
            yield line
        lines.append("== scan")
        lines.extend(radio_tests.scan(radio, REPORT_ROUNDS, USUAL_NODES))
    except MeshError as error:
        lines.append(f"FAIL {error}")
        yield lines[-1]
    with _refusing(file):
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    yield f"report written to {file}"


@contextlib.contextmanager
def _refusing(file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ConfigurationError(
            f"cannot write the report to {file}: {error.strerror or error}"
        ) from error


def _radio_in_words(options: argparse.Namespace) -> str:
    if options.emulated:
        return "emulated: these results do not come from a real chip"
    bus, device = options.spi
    irq = "not connected" if options.irq is None else f"GPIO{options.irq}"
    return f"on SPI {bus}.{device} at {options.spi_hz} Hz, CE GPIO{options.ce}, IRQ {irq}"


def _model() -> str:
    with contextlib.suppress(OSError):
        return Path("/proc/device-tree/model").read_text(encoding="ascii").rstrip("\0")
    return "not a Raspberry Pi"


@contextlib.contextmanager
def _opened(options: argparse.Namespace) -> Iterator[tuple[FieldRadio, IrqPin | None]]:
    settings = common_settings(options)
    spi: SpiDevice
    ce: CePin
    irq: IrqPin | None
    runtime: Runtime
    with contextlib.ExitStack() as stack:
        if options.emulated:
            clock = WallClock()
            stack.callback(clock.close)
            partner = EmulatedPartner(clock, settings, Location(0.0, options.emulated, 0.0))
            stack.callback(partner.close)
            chip = partner.other_chip()
            spi, ce, irq, runtime = chip.spi, chip.ce, chip.irq, clock.runtime
        else:
            spi, ce, irq = wired_hardware(options).open()
            runtime = SystemRuntime()
        if irq is not None:
            stack.callback(irq.close)
        radio = FieldRadio(spi, ce, options.id, settings, runtime)
        stack.callback(radio.close)
        yield radio, irq


class EmulatedPartner:
    """Node 1 at this place; it acknowledges what it receives, and follows a range measurement."""

    def __init__(self, clock: WallClock, settings: RadioSettings, place: Location) -> None:
        self._air = Air(clock, LogDistance(random.Random()), random.Random())
        chip = EmulatedChip(self._air, "partner", place.to_vector())
        self._radio = FieldRadio(chip.spi, chip.ce, PARTNER_ID, settings, clock.runtime)
        self._ended = False
        self._answering = clock.runtime.start(self._answer, "partner")

    def other_chip(self) -> EmulatedChip:
        """The chip that the tools work on, at (0, 0, 0)."""
        return EmulatedChip(self._air, "radio")

    def close(self) -> None:
        self._ended = True
        self._answering.join()
        self._radio.close()

    def _answer(self) -> None:
        for _ in range_test.answer(self._radio, lambda: self._ended):
            pass


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "raspberry_radio", description="Field tools for one nRF24L01+. Stop the node first."
    )
    add_wiring_options(parser)
    parser.add_argument(
        "--id",
        type=whole(0, MAX_NODE_ID),
        default=MAX_NODE_ID,
        help="id of this radio (default: %(default)s)",
    )
    add_common_options(parser)
    parser.add_argument(
        "--emulated",
        type=decimal(0.1, FARTHEST_M),
        default=0.0,
        metavar="METRES",
        help=f"without hardware: use an emulated radio, with node {PARTNER_ID} at this distance",
    )
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")

    def add_tool(name: str, text: str) -> argparse.ArgumentParser:
        return tools.add_parser(name, help=text, description=text)

    add_tool("check", "test wiring, SPI, CE, supply and IRQ")
    scan = add_tool("scan", "show the 126 channels as bars; suggest channel and rate")
    scan.add_argument(
        "--rounds",
        type=whole(1, 10_000),
        default=100,
        help="number of scans (default: %(default)s)",
    )
    scan.add_argument(
        "--nodes",
        type=whole(1, MAX_NODE_ID + 1),
        default=USUAL_NODES,
        help="number of nodes in the mesh, for the suggested rate (default: %(default)s)",
    )
    reach = add_tool("range", "measure the loss to a node at each power, as CSV")
    reach.add_argument(
        "--to", type=whole(0, MAX_NODE_ID), required=True, help="id of the other node"
    )
    reach.add_argument(
        "--packets",
        type=whole(1, 100_000),
        default=1000,
        help="number of packets at each power (default: %(default)s)",
    )
    reach.add_argument(
        "--distance",
        type=decimal(0, FARTHEST_M),
        metavar="METRES",
        help="distance to the other node: also print the loss measured near that distance in 2019",
    )
    reach.add_argument(
        "--all-rates",
        action="store_true",
        help="measure at every data rate; the other node must run 'answer', with the same --rate",
    )
    add_tool("answer", "acknowledge the packets of 'range --all-rates', at each of its rates")
    ear = add_tool("listen", "print packets to all nodes and to --id, decoded")
    ear.add_argument(
        "--seconds",
        type=decimal(0.1, MOST),
        default=math.inf,
        help="time to listen (default: until Ctrl-C)",
    )
    ear.add_argument(
        "--pcapng", type=Path, metavar="FILE", help="also write the packets to FILE, for Wireshark"
    )
    report = add_tool("report", "save check and scan in one file, for a bug report")
    report.add_argument("file", type=Path, help="text file to write")
    return parser
