"""The SPI commands of the chip [DS 8.3, Table 20]."""

from __future__ import annotations

from drone_mesh.nrf24.emulator.chip_core import ANSWERING, SENDING, ChipCore, State
from drone_mesh.nrf24.emulator.fifos import TxPayload
from drone_mesh.nrf24.emulator.shockburst import Transmitter
from drone_mesh.nrf24.registers import (
    ARC_CNT,
    MAX_PAYLOAD_BYTES,
    PIPES,
    PLOS_CNT,
    READ_ONLY,
    RX_EMPTY,
    RX_FULL,
    STATUS_FLAGS,
    TX_EMPTY,
    TX_FULL,
    TX_REUSE,
    Command,
    Register,
)

_REGISTERS = {int(register): register for register in Register}
_REGISTER_MASK = 0x1F
_ACTIVATE_KEY = 0x73
# Locked in the chip without "+" until ACTIVATE: a write has no effect, a read gives zeros (nRF24L01
# Product Specification 2.0, p. 46).
_ADVANCED = (Register.DYNPD, Register.FEATURE)
_ADVANCED_COMMANDS = frozenset(
    (
        Command.R_RX_PL_WID,
        Command.W_TX_PAYLOAD_NO_ACK,
        *range(Command.W_ACK_PAYLOAD, Command.W_ACK_PAYLOAD + PIPES),
    )
)
_ACTIVE = SENDING | ANSWERING | {State.RX_SETTLING, State.RX}


class CommandDecoder:
    """Executes an SPI command when CSN rises."""

    def __init__(self, chip: ChipCore, transmitter: Transmitter) -> None:
        self._chip = chip
        self._transmitter = transmitter
        self._advanced_unlocked = chip.variant.plus

    def execute(self, mosi: bytes) -> bytes:
        """Execute a command; returns the bytes that leave while those after the command arrive."""
        command, data = mosi[0], mosi[1:]
        if command in _ADVANCED_COMMANDS and not self._advanced_unlocked:
            return bytes(len(data))
        if command < Command.W_REGISTER:
            return self._read(command & _REGISTER_MASK, len(data))
        if command < 2 * Command.W_REGISTER:
            self._write(command & _REGISTER_MASK, data)
        elif command == Command.R_RX_PAYLOAD:
            if self._chip.rx_fifo.oldest is None:
                self._chip.warn("R_RX_PAYLOAD while the RX FIFO is empty")
            return self._chip.rx_fifo.read(len(data))
        elif command == Command.R_RX_PL_WID:
            oldest = self._chip.rx_fifo.oldest
            return bytes((oldest.reported_width if oldest else 0,)) * len(data)
        else:
            self._act(command, data)
        return bytes(len(data))

    def _act(self, command: int, data: bytes) -> None:
        chip = self._chip
        if command == Command.W_TX_PAYLOAD:
            self._load(data, no_ack=False)
        elif command == Command.W_TX_PAYLOAD_NO_ACK:
            # Without EN_DYN_ACK, silicon sends an ordinary packet with acknowledgement.
            self._load(data, no_ack=chip.registers.dynamic_ack)
        elif Command.W_ACK_PAYLOAD <= command < Command.W_ACK_PAYLOAD + PIPES:
            if not chip.registers.ack_payloads:
                chip.warn("W_ACK_PAYLOAD without EN_ACK_PAY")
            self._push(TxPayload(data[:MAX_PAYLOAD_BYTES], ack_pipe=command & 7))
        elif command == Command.FLUSH_TX:
            chip.tx_fifo.flush()
            self._transmitter.reuse = False  # the current packet ends without TX_DS or MAX_RT
        elif command == Command.FLUSH_RX:
            if chip.state in ANSWERING:
                chip.warn("FLUSH_RX while an acknowledgement is being sent")
            chip.rx_fifo.flush()
        elif command == Command.REUSE_TX_PL:
            self._transmitter.reuse = True
        elif command == Command.ACTIVATE:
            if not chip.variant.plus and data == bytes((_ACTIVATE_KEY,)):
                self._advanced_unlocked = not self._advanced_unlocked
        elif command != Command.NOP:
            chip.warn(f"unknown SPI command 0x{command:02X}")

    def _load(self, data: bytes, *, no_ack: bool) -> None:
        chip = self._chip
        if not 1 <= len(data) <= MAX_PAYLOAD_BYTES:
            chip.warn(f"a payload of {len(data)} bytes was written")
            data = data[:MAX_PAYLOAD_BYTES]
        packet = TxPayload(data, no_ack=no_ack)
        if self._push(packet):
            packet.pid = self._transmitter.next_pid()
            self._transmitter.payload_written()

    def _push(self, packet: TxPayload) -> bool:
        if self._chip.tx_fifo.push(packet):
            return True
        self._chip.warn("a payload was written while the TX FIFO was full, and is lost")
        return False

    def _read(self, address: int, count: int) -> bytes:
        chip = self._chip
        register = _REGISTERS.get(address)
        if register is None:
            return bytes(count)
        if register is Register.STATUS:
            value = bytes((chip.status(),))
        elif register is Register.OBSERVE_TX:
            sender = self._transmitter
            value = bytes((PLOS_CNT.put(sender.packets_lost) | ARC_CNT.put(sender.retransmits),))
        elif register is Register.RPD:
            value = bytes((chip.rpd(),))
        elif register is Register.FIFO_STATUS:
            value = bytes((self._fifo_status(),))
        elif register in _ADVANCED and not self._advanced_unlocked:
            value = b"\0"
        else:
            value = chip.registers.read(register)
        return value[:count].ljust(count, b"\0")

    def _fifo_status(self) -> int:
        chip = self._chip
        value = TX_REUSE.mask if self._transmitter.reuse else 0
        if chip.tx_fifo.oldest is None:
            value |= TX_EMPTY.mask
        elif chip.tx_fifo.full:
            value |= TX_FULL.mask
        if chip.rx_fifo.oldest is None:
            value |= RX_EMPTY.mask
        elif chip.rx_fifo.full:
            value |= RX_FULL.mask
        return value

    def _write(self, address: int, data: bytes) -> None:
        chip = self._chip
        register = _REGISTERS.get(address)
        if register is None or not data:
            chip.warn(f"a write to register 0x{address:02X}, which does not exist or is reserved")
            return
        if register is Register.STATUS:
            chip.clear_flags(data[0] & STATUS_FLAGS)
            return
        if register in READ_ONLY or (register in _ADVANCED and not self._advanced_unlocked):
            return
        if register is not Register.CONFIG and chip.state in _ACTIVE:
            chip.warn(f"{register.name} written outside power down and standby")
        registers = chip.registers
        was_powered, was_receiver = registers.powered, registers.receiver
        was_tuned_to = (registers.channel, registers.bits_per_s)
        registers.write(register, data)
        if register is Register.CONFIG:
            chip.config_written(was_powered, was_receiver)
        elif register is Register.RF_CH:
            self._transmitter.packets_lost = 0
        if was_tuned_to != (registers.channel, registers.bits_per_s):
            chip.retune()
