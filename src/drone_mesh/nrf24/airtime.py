"""Durations: states of the chip [DS 6.1.7, Table 16] and frames on the air [DS 7.3, 7.4].

All times are integer nanoseconds, so that nothing is ever rounded: one bit lasts 4000, 1000 or 500
ns.
"""

from __future__ import annotations

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


def failed_cycle_ns(data_ns: int, ard_ns: int, retransmits: int) -> int:
    """From the rise of CE to MAX_RT.

    ARD starts at the end of a frame; the settling before the next frame is added [DS Fig. 17].
    """
    return SETTLING_NS + (retransmits + 1) * (data_ns + ard_ns) + retransmits * SETTLING_NS
