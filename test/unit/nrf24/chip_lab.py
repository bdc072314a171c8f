"""A workbench for the tests: chips, wires to them, and drivers, under the virtual clock."""

from __future__ import annotations

import random
from functools import partial

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.chip_core import ChipVariant
from drone_mesh.nrf24.emulator.cooperative_clock import CooperativeClock
from drone_mesh.nrf24.emulator.links import IdealDisc, ScriptedLoss
from drone_mesh.nrf24.emulator.trace import FrameTrace
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.registers import Command, Register
from drone_mesh.nrf24.settings import RadioSettings

RATES = {"250k": 0x26, "1M": 0x06, "2M": 0x0E}  # RF_SETUP with 0 dBm
ADDRESS = bytes.fromhex("0A68524D54")  # node 10, LSByte first
BROADCAST_ADDRESS = bytes.fromhex("FE68524D54")
PAYLOAD = bytes(range(32))


class Wires:
    """SPI and CE of one chip, in the words of the datasheet."""

    def __init__(self, lab, chip):
        self.lab, self.chip = lab, chip

    def command(self, command, data=b""):
        answer = self.chip.spi.xfer2([command, *data])
        self.first_byte = answer[0]
        return bytes(answer[1:])

    def read(self, register, count=1):
        return self.command(Command.R_REGISTER | register, bytes(count))

    def byte(self, register):
        return self.read(register)[0]

    def write(self, register, value):
        data = bytes((value,)) if isinstance(value, int) else value
        self.command(Command.W_REGISTER | register, data)

    @property
    def status(self):
        self.command(Command.NOP)
        return self.first_byte

    def load(self, payload=PAYLOAD, no_ack=False):
        self.command(Command.W_TX_PAYLOAD_NO_ACK if no_ack else Command.W_TX_PAYLOAD, payload)

    def unload(self, count=32):
        return self.command(Command.R_RX_PAYLOAD, bytes(count))

    def unload_all(self):
        """Payloads with their pipes, as long as there are any."""
        found = []
        while not self.byte(Register.FIFO_STATUS) & 0x01:
            pipe = self.first_byte >> 1 & 7
            found.append((pipe, self.unload()))
        self.write(Register.STATUS, 0x40)
        return found

    def pulse(self, microseconds=20):
        """A pulse of CE; returns the time at which it rose, in ns."""
        rose_ns = self.lab.clock.now_ns
        self.chip.ce.value = True
        self.lab.wait_us(microseconds)
        self.chip.ce.value = False
        return rose_ns

    def send(self, payload=PAYLOAD, no_ack=False):
        """Load and pulse, wait until the chip is done; the flags, which are then cleared."""
        self.load(payload, no_ack)
        self.pulse()
        self.lab.wait_us(90_000)
        flags = self.status & 0x30
        self.write(Register.STATUS, flags)
        return flags

    def power_up(self, config):
        self.write(Register.CONFIG, config)
        self.lab.wait_us(5_000)

    def set_up(self, rate="250k", crc_bytes=2, retries=0x5F, channel=1, en_aa=0x3F, width=32):
        """What both ends share; power down afterwards."""
        self.write(Register.CONFIG, 0x08 | (crc_bytes - 1) << 2)
        self.write(Register.EN_AA, en_aa)
        self.write(Register.SETUP_RETR, retries)
        self.write(Register.RF_CH, channel)
        self.write(Register.RF_SETUP, RATES[rate])
        for pipe in range(3):
            self.write(Register.RX_PW_P0 + pipe, width)

    def become_ptx(self, address=ADDRESS, **settings):
        """A transmitter in standby."""
        self.set_up(**settings)
        self.write(Register.EN_RXADDR, 0x01)
        self.write(Register.TX_ADDR, address)
        self.write(Register.RX_ADDR_P0, address)
        self.power_up(self.byte(Register.CONFIG) | 0x02)
        return self

    def become_prx(self, address=ADDRESS, **settings):
        """A receiver that listens: broadcasts on pipe 1, its own address on pipe 2."""
        self.set_up(**settings)
        self.write(Register.EN_RXADDR, 0x06)
        self.write(Register.RX_ADDR_P1, BROADCAST_ADDRESS)
        self.write(Register.RX_ADDR_P2, address[:1])
        self.power_up(self.byte(Register.CONFIG) | 0x03)
        self.chip.ce.value = True
        self.lab.wait_us(200)
        return self


class Lab:
    """One air. `loses` may be set to a function of a Hop that says which frames get lost."""

    def __init__(self, links=None):
        self.clock = CooperativeClock()
        self.loses = lambda hop: False
        model = ScriptedLoss(links or IdealDisc(1000.0), lambda hop: self.loses(hop))
        self.air = Air(self.clock, model, random.Random(7))
        self.trace = FrameTrace()
        self.air.observe(self.trace.see)
        self.chips = []

    def wait_us(self, microseconds):
        self.clock.elapse(round(microseconds * 1000))

    def wires(self, name, x_m=0.0, **variant):
        chip = EmulatedChip(self.air, name, (x_m, 0.0, 0.0), ChipVariant(**variant))
        self.chips.append(chip)
        return Wires(self, chip)

    def pair(self, **settings):
        """A transmitter, and a receiver 100 m away."""
        ptx = self.wires("ptx").become_ptx(**settings)
        return ptx, self.wires("prx", 100.0).become_prx(**settings)

    def driver(
        self,
        node_id,
        x_m=0.0,
        *,
        irq=True,
        begin=True,
        plus=True,
        settings=None,
        **settings_changes,
    ):
        """Our driver on a chip of its own; the chip is `driver.chip`."""
        chip = EmulatedChip(self.air, f"node {node_id}", (x_m, 0.0, 0.0), ChipVariant(plus=plus))
        self.chips.append(chip)
        driver = NRF24LowLevelInterface(
            chip.spi,
            chip.ce,
            chip.irq if irq else None,
            node_id=node_id,
            settings=settings or RadioSettings(**settings_changes),
            runtime=self.clock,
            rng=random.Random(f"lab {node_id}"),
        )
        driver.chip = chip
        if begin:
            driver.begin()
        return driver

    def at_once(self, *functions):
        """Run functions beside each other; what they return, in order."""
        results = [None] * len(functions)

        def run(index, function):
            results[index] = function()

        tasks = [
            self.clock.start(partial(run, index, function), f"test {index}")
            for index, function in enumerate(functions)
        ]
        for task in tasks:
            task.join()
        return results

    @property
    def warnings(self):
        return [warning for chip in self.chips for warning in chip.warnings]

    def frames_from(self, name, answers=False):
        return [
            frame
            for frame in self.trace.frames
            if frame.sender == name and frame.is_answer == answers
        ]


def us(nanoseconds):
    return nanoseconds / 1000
