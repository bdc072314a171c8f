"""SPI and registers of the emulated chip (docs/radio.md, "Checklist A: SPI and registers")."""

from __future__ import annotations

import pytest
from chip_lab import PAYLOAD

from drone_mesh.nrf24.emulator.fifos import Incoming
from drone_mesh.nrf24.emulator.frames import Frame, FrameFormat, frame_crc
from drone_mesh.nrf24.registers import Command, Register

RESET = {
    0x00: "08", 0x01: "3F", 0x02: "03", 0x03: "03", 0x04: "03", 0x05: "02", 0x06: "0E", 0x07: "0E",
    0x08: "00", 0x09: "00", 0x0A: "E7E7E7E7E7", 0x0B: "C2C2C2C2C2", 0x0C: "C3", 0x0D: "C4",
    0x0E: "C5", 0x0F: "C6", 0x10: "E7E7E7E7E7", 0x11: "00", 0x12: "00", 0x13: "00", 0x14: "00",
    0x15: "00", 0x16: "00", 0x17: "11", 0x1C: "00", 0x1D: "00",
}  # fmt: skip


def test_row_01_registers_have_their_reset_values_after_power_on(lab):
    wires = lab.wires("chip")
    found = {address: wires.read(address, len(value) // 2) for address, value in RESET.items()}
    assert found == {address: bytes.fromhex(value) for address, value in RESET.items()}


def test_row_02_the_first_byte_of_any_answer_is_the_status_before_the_command(lab):
    wires = lab.wires("chip")
    for _ in range(3):
        wires.load()
        assert wires.first_byte == 0x0E
    wires.command(Command.FLUSH_TX)
    assert wires.first_byte == 0x0F
    wires.read(Register.CONFIG)
    assert wires.first_byte == 0x0E


def test_row_03_writing_one_byte_of_an_address_leaves_the_others(lab):
    wires = lab.wires("chip")
    wires.write(Register.RX_ADDR_P0, b"\x11")
    assert wires.read(Register.RX_ADDR_P0, 5) == bytes.fromhex("11 E7 E7 E7 E7")


@pytest.mark.parametrize("register", [Register.OBSERVE_TX, Register.RPD, Register.FIFO_STATUS])
def test_row_04_read_only_registers_do_not_change(lab, register):
    wires = lab.wires("chip")
    before = wires.byte(register)
    wires.write(register, 0xFF)
    assert wires.byte(register) == before


def test_row_05_writing_70_to_status_clears_the_flags_and_nothing_else(lab):
    ptx, prx = lab.pair()
    for _ in range(3):
        ptx.load()
    ptx.pulse()
    lab.wait_us(5_000)
    assert ptx.status == 0x2E
    ptx.write(Register.STATUS, 0x70)
    assert ptx.first_byte == 0x2E
    assert ptx.status == 0x0E
    prx.write(Register.STATUS, 0x70)
    assert (prx.first_byte, prx.status) == (0x44, 0x04)  # pipe 2 stays


def test_row_05_tx_full_stays_when_status_is_written(lab):
    wires = lab.wires("chip")
    for _ in range(3):
        wires.load()
    wires.write(Register.STATUS, 0x70)
    assert wires.status == 0x0F


def test_row_06_activate_does_nothing_to_the_plus_chip(lab):
    wires = lab.wires("chip")
    wires.write(Register.FEATURE, 0x05)
    wires.command(Command.ACTIVATE, b"\x73")
    assert wires.byte(Register.FEATURE) == 0x05


def test_row_06_activate_toggles_access_in_the_chip_without_plus(lab):
    wires = lab.wires("chip", plus=False)
    wires.write(Register.FEATURE, 0x05)
    assert wires.byte(Register.FEATURE) == 0x00
    wires.command(Command.ACTIVATE, b"\x73")
    wires.write(Register.FEATURE, 0x05)
    assert wires.byte(Register.FEATURE) == 0x05
    wires.command(Command.ACTIVATE, b"\x73")
    assert wires.byte(Register.FEATURE) == 0x00


def test_row_06_commands_that_the_chip_without_plus_has_not_activated_do_nothing(lab):
    """nRF24L01 Product Specification 2.0, p. 46: a write has no effect, a read gives zeros."""
    old = lab.wires("old", plus=False)
    old.command(Command.W_TX_PAYLOAD_NO_ACK, b"\x55" * 32)
    old.command(Command.W_ACK_PAYLOAD, b"\x55" * 32)
    assert old.byte(Register.FIFO_STATUS) == 0x11  # both FIFOs are empty
    old.chip.rx_fifo.push(Incoming(2, PAYLOAD, 32))
    assert old.command(Command.R_RX_PL_WID, b"\0") == b"\0"
    old.command(Command.ACTIVATE, b"\x73")
    assert old.command(Command.R_RX_PL_WID, b"\0") == b"\x20"
    old.command(Command.W_TX_PAYLOAD_NO_ACK, b"\x55" * 32)
    assert old.byte(Register.FIFO_STATUS) == 0x00


def test_row_07_registers_and_fifos_survive_power_down(lab):
    ptx, prx = lab.pair()
    assert ptx.send() == 0x20
    ptx.load(b"\x55" * 32)
    for wires in (ptx, prx):
        config = wires.byte(Register.CONFIG)
        wires.write(Register.CONFIG, config & ~0x02)
        lab.wait_us(1_000)
        wires.power_up(config)
    assert ptx.byte(Register.SETUP_RETR) == 0x5F
    assert prx.unload() == PAYLOAD
    ptx.pulse()
    lab.wait_us(5_000)
    assert prx.unload() == b"\x55" * 32


@pytest.mark.parametrize(("pid", "crc"), [(0, 0x4E4E), (1, 0x6E0C)])
def test_row_08_acknowledgements_have_the_crc_that_a_real_chip_sent(pid, crc):
    address = bytes.fromhex("65 64 6F 4E 31")  # "1Node", as it is on the air
    control = 0x33 << 3 | pid << 1
    assert frame_crc(address, control, b"", 2) == crc
    frame = Frame.encode(address, b"", FrameFormat(5, 2, True, 0), pid)
    # 0x55, the address, 110011 and the PID and 0, then the CRC, seven bits of filling
    bits = f"{0x55:08b}{int.from_bytes(address, 'big'):040b}{control:09b}{crc:016b}".ljust(80, "0")
    assert frame.to_bytes() == int(bits, 2).to_bytes(10, "big")


def test_row_09_irq_is_low_until_the_flag_is_cleared_and_only_if_not_masked(lab):
    ptx, prx = lab.pair()
    assert prx.chip.irq.value
    ptx.send()
    assert not prx.chip.irq.value
    prx.write(Register.STATUS, 0x40)
    assert prx.chip.irq.value
    prx.write(Register.CONFIG, prx.byte(Register.CONFIG) | 0x40)
    ptx.send(b"\x01" * 32)
    assert prx.status & 0x40
    assert prx.chip.irq.value
