"""Frames as bits on the air [DS 7.3].

    preamble 8 | address 16..40 | PCF 9 | payload 0..256 | CRC 0, 8 or 16

with everything MSBit first and the address from its most significant byte. The packet control field
is 6 bits length, 2 bits PID, 1 bit NO_ACK; plain ShockBurst frames have none. The CRC covers
address, PCF and payload. Acknowledgements recorded on a real chip confirm CRC16 and the bit order;
see the tests.
"""

from __future__ import annotations

import binascii
from dataclasses import dataclass
from typing import NamedTuple

from drone_mesh.nrf24.registers import PCF_BITS, PREAMBLE_BITS

STATIC_LENGTH_FIELD = 0x33  # the length field that silicon sends while DPL is off
_CRC8_POLYNOMIAL = 0x07  # x^8 + x^2 + x + 1, initial value 0xFF
_CRC16_POLYNOMIAL = 0x1021  # x^16 + x^12 + x^5 + 1, initial value 0xFFFF


def _crc8_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (_CRC8_POLYNOMIAL if byte & 0x80 else 0)
        table.append(byte & 0xFF)
    return tuple(table)


_CRC8 = _crc8_table()


def _crc_of_bytes(data: bytes, crc: int, crc_bytes: int) -> int:
    if crc_bytes == 2:
        return binascii.crc_hqx(data, crc)
    for byte in data:
        crc = _CRC8[crc ^ byte]
    return crc


def _crc_of_bit(bit: int, crc: int, crc_bytes: int) -> int:
    top, polynomial = (15, _CRC16_POLYNOMIAL) if crc_bytes == 2 else (7, _CRC8_POLYNOMIAL)
    feedback = bit ^ crc >> top
    crc = crc << 1 & ((2 << top) - 1)
    return crc ^ polynomial if feedback else crc


def frame_crc(address: bytes, control: int | None, payload: bytes, crc_bytes: int) -> int:
    """CRC of a frame; `address` most significant byte first, `control` the 9 bits of the PCF."""
    crc = 0xFFFF if crc_bytes == 2 else 0xFF
    if control is None:
        return _crc_of_bytes(address + payload, crc, crc_bytes)
    crc = _crc_of_bytes(address + bytes((control >> 1,)), crc, crc_bytes)
    return _crc_of_bytes(payload, _crc_of_bit(control & 1, crc, crc_bytes), crc_bytes)


class FrameFormat(NamedTuple):
    """The configuration of a receiver's pipe, which determines the parts of a frame."""

    address_bytes: int
    crc_bytes: int
    enhanced: bool  # with packet control field
    payload_bytes: int | None  # None: given by the length field


@dataclass(frozen=True)
class Packet:
    """The parts of a frame, as a receiver decodes them."""

    pid: int
    no_ack_bit: int  # as it is on the air
    payload: bytes
    crc: int


class Frame:
    """A sequence of bits. Caches how it was decoded, because a frame has many receivers."""

    __slots__ = ("_addresses", "_packets", "bit_count", "bits")

    def __init__(self, bits: int, bit_count: int) -> None:
        self.bits = bits
        self.bit_count = bit_count
        self._addresses: dict[int, int] = {}
        self._packets: dict[FrameFormat, Packet | None] = {}

    @classmethod
    def encode(
        cls, address: bytes, payload: bytes, form: FrameFormat, pid: int = 0, no_ack_bit: int = 0
    ) -> Frame:
        """The frame a transmitter with that configuration sends; `address` MSByte first."""
        bits = 0xAA if address[0] & 0x80 else 0x55
        bits = bits << 8 * len(address) | int.from_bytes(address, "big")
        count = PREAMBLE_BITS + 8 * len(address)
        control = None
        if form.enhanced:
            length = len(payload) if form.payload_bytes is None else STATIC_LENGTH_FIELD
            control = length << 3 | pid << 1 | no_ack_bit
            bits = bits << PCF_BITS | control
            count += PCF_BITS
        bits = bits << 8 * len(payload) | int.from_bytes(payload, "big")
        crc = 0
        if form.crc_bytes:
            crc = frame_crc(address, control, payload, form.crc_bytes)
            bits = bits << 8 * form.crc_bytes | crc
        frame = cls(bits, count + 8 * (len(payload) + form.crc_bytes))
        # A receiver with the same configuration decodes the same packet: cache it.
        frame._packets[form] = Packet(pid, no_ack_bit, payload, crc)
        return frame

    def address(self, address_bytes: int) -> int:
        """The address, as a number, for a receiver with this address width."""
        address = self._addresses.get(address_bytes)
        if address is None:
            address = self._addresses[address_bytes] = self._bits_at(
                PREAMBLE_BITS, 8 * address_bytes
            )
        return address

    def decode(self, form: FrameFormat) -> Packet | None:
        """The packet that a receiver with this configuration decodes; None if the CRC is wrong."""
        try:
            return self._packets[form]
        except KeyError:
            packet = self._packets[form] = self._find_packet(form)
            return packet

    def with_errors(self, *bit_indexes: int) -> Frame:
        """The same frame with some bits flipped; index 0 is the first bit on the air."""
        bits = self.bits
        for index in bit_indexes:
            bits ^= 1 << (self.bit_count - 1 - index)
        return Frame(bits, self.bit_count)

    def to_bytes(self) -> bytes:
        """The bits from first to last, padded with zeros to whole bytes."""
        padding = -self.bit_count % 8
        return (self.bits << padding).to_bytes((self.bit_count + padding) // 8, "big")

    def _bits_at(self, position: int, width: int) -> int:
        return self.bits >> (self.bit_count - position - width) & ((1 << width) - 1)

    def _find_packet(self, form: FrameFormat) -> Packet | None:
        position = PREAMBLE_BITS + 8 * form.address_bytes
        control, length = None, form.payload_bytes
        if form.enhanced:
            if position + PCF_BITS > self.bit_count:
                return None
            control = self._bits_at(position, PCF_BITS)
            position += PCF_BITS
            if length is None:
                length = control >> 3
        if length is None or position + 8 * (length + form.crc_bytes) > self.bit_count:
            return None  # the rest would be noise
        payload = self._bits_at(position, 8 * length).to_bytes(length, "big")
        crc = self._bits_at(position + 8 * length, 8 * form.crc_bytes)
        if form.crc_bytes:
            address = self.address(form.address_bytes).to_bytes(form.address_bytes, "big")
            if crc != frame_crc(address, control, payload, form.crc_bytes):
                return None
        if control is None:
            return Packet(0, 0, payload, crc)
        return Packet(control >> 1 & 3, control & 1, payload, crc)
