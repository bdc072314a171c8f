"""Variants and faults of chips."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.nrf24.airtime import POWER_UP_NS


@dataclass(frozen=True)
class ChipVariant:
    """Properties of a chip. The defaults are those of a genuine nRF24L01+.

    There is a switch for each behaviour that no source settles.
    """

    plus: bool = True  # False: no 250 kbit/s; ACTIVATE 0x73 must unlock FEATURE and DYNPD
    power_up_ns: int = POWER_UP_NS  # Tpd2stby, depends on the crystal
    no_ack_bit: int = 1  # on the air, for "do not acknowledge": 1 by the datasheet, 0 in nRF5 chips
    duplicates_by_pipe: bool = True  # False: one memory of the last PID and CRC for all pipes
    partial_read_removes: bool = False  # True: a payload that was read in part leaves the FIFO


@dataclass
class ChipFaults:
    """The current faults; may be changed at any time."""

    miso_stuck_at: int | None = None  # 0x00 or 0xFF: nothing answers, or nothing is connected
    irq_stuck_at: bool | None = None  # level of the pin
    dead_transmitter: bool = False
    dead_receiver: bool = False
    next_width: int | None = None  # R_RX_PL_WID, once: as for a broken frame that passed the CRC
