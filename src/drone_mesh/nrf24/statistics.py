"""What a radio has done so far, in numbers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class RadioStatistics:
    """Counters since the driver was made; each is written under the driver's lock only."""

    sent: int = 0  # packets with acknowledgement that were to be sent
    acknowledged: int = 0  # of these: the receiver has them
    lost: int = 0  # of these: given up
    retries: int = 0  # repetitions by the chip
    tries: int = 0  # repetitions by the driver, after a pause
    broadcasts: int = 0  # sent
    received: int = 0  # payloads that came in
    corrupt: int = 0  # frames that were broken and yet passed the CRC; thrown away
    restarts: int = 0  # the chip had lost its settings, or hung, and was set anew
    irq_fallbacks: int = 0  # the IRQ pin did not do what it should; polling instead
    duplicates: int = 0  # seen by the antenna: the same packet from the same node again, at once
