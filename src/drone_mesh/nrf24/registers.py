"""SPI commands, registers, bit fields and times of the nRF24L01+, under the names of the datasheet.

Commands: [DS 8.3.1, Table 20, p. 51]. Registers and fields: [DS 9.1, Table 28, pp. 57-63].
Durations of states [DS 6.1.7, Table 16] and frames on the air [DS 7.3, 7.4] are integer
nanoseconds, so that nothing is ever rounded: one bit lasts 4000, 1000 or 500 ns.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

MAX_PAYLOAD_BYTES = 32  # [DS 7.3.4]
PIPES = 6  # [DS 7.6]
FIFO_DEPTH = 3  # payloads, in each direction [DS 7.5.2]
ADDRESS_BYTES = 5  # the widest address [DS 7.3.2]


class Command(enum.IntEnum):
    """First byte of an SPI transfer [DS Table 20, p. 51]."""

    R_REGISTER = 0x00  # + register address
    W_REGISTER = 0x20  # + register address
    R_RX_PL_WID = 0x60  # width of the oldest received payload
    R_RX_PAYLOAD = 0x61
    W_TX_PAYLOAD = 0xA0
    W_ACK_PAYLOAD = 0xA8  # + pipe
    W_TX_PAYLOAD_NO_ACK = 0xB0  # needs EN_DYN_ACK
    FLUSH_TX = 0xE1
    FLUSH_RX = 0xE2
    REUSE_TX_PL = 0xE3
    ACTIVATE = 0x50  # of the older chip without "+"; the plus chip ignores it
    NOP = 0xFF


class Register(enum.IntEnum):
    """Addresses of the register map [DS Table 28, pp. 57-63]."""

    CONFIG = 0x00
    EN_AA = 0x01
    EN_RXADDR = 0x02
    SETUP_AW = 0x03
    SETUP_RETR = 0x04
    RF_CH = 0x05
    RF_SETUP = 0x06
    STATUS = 0x07
    OBSERVE_TX = 0x08
    RPD = 0x09
    RX_ADDR_P0 = 0x0A
    RX_ADDR_P1 = 0x0B
    RX_ADDR_P2 = 0x0C
    RX_ADDR_P3 = 0x0D
    RX_ADDR_P4 = 0x0E
    RX_ADDR_P5 = 0x0F
    TX_ADDR = 0x10
    RX_PW_P0 = 0x11
    RX_PW_P1 = 0x12
    RX_PW_P2 = 0x13
    RX_PW_P3 = 0x14
    RX_PW_P4 = 0x15
    RX_PW_P5 = 0x16
    FIFO_STATUS = 0x17
    DYNPD = 0x1C
    FEATURE = 0x1D


@dataclass(frozen=True)
class BitField:
    """A group of adjacent bits in one register."""

    register: Register
    lsb: int
    width: int = 1
    mask: int = field(init=False)  # the bits of the field, at their position in the register

    def __post_init__(self) -> None:
        object.__setattr__(self, "mask", ((1 << self.width) - 1) << self.lsb)

    def get(self, register_value: int) -> int:
        return (register_value & self.mask) >> self.lsb

    def put(self, value: int, register_value: int = 0) -> int:
        """The register's value with the field set to `value`; ValueError if it does not fit."""
        if not 0 <= value < 1 << self.width:
            raise ValueError(f"{self.register.name}: {value} is outside 0..{(1 << self.width) - 1}")
        return (register_value & ~self.mask) | value << self.lsb


# CONFIG, p. 57
EN_CRC = BitField(Register.CONFIG, 3)  # forced on while any bit of EN_AA is set
CRCO = BitField(Register.CONFIG, 2)  # 1: 2 bytes of CRC, 0: 1 byte
PWR_UP = BitField(Register.CONFIG, 1)
PRIM_RX = BitField(Register.CONFIG, 0)  # 1: receiver, 0: transmitter

# EN_AA, p. 57, and EN_RXADDR, p. 58: one bit a pipe
ENAA = tuple(BitField(Register.EN_AA, pipe) for pipe in range(PIPES))
ERX = tuple(BitField(Register.EN_RXADDR, pipe) for pipe in range(PIPES))

AW = BitField(Register.SETUP_AW, 0, 2)  # p. 58; 1, 2, 3 = 3, 4, 5 bytes
ARD = BitField(Register.SETUP_RETR, 4, 4)  # p. 58; (n + 1) * 250 us
ARC = BitField(Register.SETUP_RETR, 0, 4)  # p. 58; automatic retransmits, 0..15

# RF_SETUP, p. 59
RF_DR_LOW = BitField(Register.RF_SETUP, 5)  # 1: 250 kbit/s
RF_DR_HIGH = BitField(Register.RF_SETUP, 3)  # 1: 2 Mbit/s, if RF_DR_LOW is 0
RF_PWR = BitField(Register.RF_SETUP, 1, 2)  # -18, -12, -6, 0 dBm

# STATUS, p. 59; a flag is cleared by writing 1 to it
RX_DR = BitField(Register.STATUS, 6)  # a payload arrived
TX_DS = BitField(Register.STATUS, 5)  # sent, and acknowledged if requested
MAX_RT = BitField(Register.STATUS, 4)  # all retransmits used up; blocks sending until cleared
RX_P_NO = BitField(Register.STATUS, 1, 3)  # pipe of the oldest payload, RX_FIFO_IS_EMPTY if none
RX_FIFO_IS_EMPTY = 7  # value of RX_P_NO

PLOS_CNT = BitField(Register.OBSERVE_TX, 4, 4)  # p. 60; MAX_RT events since RF_CH was written
ARC_CNT = BitField(Register.OBSERVE_TX, 0, 4)  # p. 60; retransmits of the current packet
RPD = BitField(Register.RPD, 0)  # p. 60; more than -64 dBm received

# FIFO_STATUS, p. 61
TX_REUSE = BitField(Register.FIFO_STATUS, 6)
TX_FULL = BitField(Register.FIFO_STATUS, 5)
TX_EMPTY = BitField(Register.FIFO_STATUS, 4)
RX_FULL = BitField(Register.FIFO_STATUS, 1)
RX_EMPTY = BitField(Register.FIFO_STATUS, 0)

DPL = tuple(BitField(Register.DYNPD, pipe) for pipe in range(PIPES))  # p. 62
EN_DPL = BitField(Register.FEATURE, 2)  # p. 63
EN_ACK_PAY = BitField(Register.FEATURE, 1)
EN_DYN_ACK = BitField(Register.FEATURE, 0)  # allows W_TX_PAYLOAD_NO_ACK

STATUS_FLAGS = RX_DR.mask | TX_DS.mask | MAX_RT.mask

RESET_VALUES: dict[Register, bytes] = {
    Register.CONFIG: b"\x08",
    Register.EN_AA: b"\x3f",
    Register.EN_RXADDR: b"\x03",
    Register.SETUP_AW: b"\x03",
    Register.SETUP_RETR: b"\x03",
    Register.RF_CH: b"\x02",
    Register.RF_SETUP: b"\x0e",
    Register.STATUS: b"\x0e",
    Register.OBSERVE_TX: b"\x00",
    Register.RPD: b"\x00",
    Register.RX_ADDR_P0: b"\xe7\xe7\xe7\xe7\xe7",
    Register.RX_ADDR_P1: b"\xc2\xc2\xc2\xc2\xc2",
    Register.RX_ADDR_P2: b"\xc3",
    Register.RX_ADDR_P3: b"\xc4",
    Register.RX_ADDR_P4: b"\xc5",
    Register.RX_ADDR_P5: b"\xc6",
    Register.TX_ADDR: b"\xe7\xe7\xe7\xe7\xe7",
    **{Register(Register.RX_PW_P0 + pipe): b"\x00" for pipe in range(PIPES)},
    Register.FIFO_STATUS: b"\x11",
    Register.DYNPD: b"\x00",
    Register.FEATURE: b"\x00",
}
"""Values after power-on, multi-byte ones LSByte first [DS Table 28, pp. 57-63]."""

READ_ONLY: frozenset[Register] = frozenset(
    (Register.OBSERVE_TX, Register.RPD, Register.FIFO_STATUS)
)


NS_PER_S = 1_000_000_000

SETTLING_NS = 130_000  # Tstby2a: standby -> TX or RX, and every turnaround
CE_PULSE_MIN_NS = 10_000  # Thce: a shorter pulse of CE sends nothing
CE_TO_CSN_NS = 4_000  # Tpece2csn: CE rising -> CSN low
POWER_UP_NS = 1_500_000  # Tpd2stby with a crystal of Ls <= 30 mH; up to 4.5 ms with others
ARD_STEP_NS = 250_000  # SETUP_RETR: ARD = (n + 1) steps

PREAMBLE_BITS = 8
PCF_BITS = 9  # packet control field: 6 bit length, 2 bit PID, 1 bit NO_ACK


def frame_bits(address_bytes: int, payload_bytes: int, crc_bytes: int) -> int:
    """Bits on the air of one frame with packet control field [DS 7.3]."""
    return PREAMBLE_BITS + PCF_BITS + 8 * (address_bytes + payload_bytes + crc_bytes)


def ard_s(delay: int) -> float:
    """ARD of SETUP_RETR in seconds: from the end of a frame until the chip starts the next one."""
    return (delay + 1) * ARD_STEP_NS / NS_PER_S
