"""Counters of a radio, and how well packets reach each neighbour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Mapping, NamedTuple

from drone_mesh.communication.timing import ChannelUse

_LEARNING = 0.1  # weight of the latest packet in the quality of a link


@dataclass
class RadioStatistics:
    """Counters since the driver was created; each is written under one lock only.

    That is the lock of the queue for packets by outcome, and that of the driver for the rest.
    """

    sent: int = 0  # packets that request an acknowledgement
    acknowledged: int = 0  # of these: received
    lost: int = 0  # of these: given up
    retries: int = 0  # retransmissions by the chip
    tries: int = 0  # further tries by the driver, after a pause
    broadcasts: int = 0  # sent
    received: int = 0  # payloads received
    corrupt: int = 0  # damaged frames that passed the CRC; dropped
    restarts: int = 0  # set-ups after the chip had lost its settings or hung
    irq_fallbacks: int = 0  # the IRQ pin failed; polling instead
    airtime_s: float = 0.0  # of the frames that it sent, including acknowledgements
    waiting: int = 0  # packets in the queue now
    contention: float = 0.0  # share of first tries that failed recently, as the sender estimates it
    duplicates: int = 0  # packets that the antenna received again from the same node, at once

    @property
    def tries_per_packet(self) -> float:
        """Mean over packets delivered or given up; 1 while there are none."""
        return 1.0 + self.tries / self.sent if self.sent else 1.0


AIRTIME_WINDOW_S = 1.0  # the airtime share is measured over at least this time


class ChannelMeter:
    """Derives figures for display from the counters of one radio. One thread at a time."""

    def __init__(self, now_s: float) -> None:
        self._since_s = now_s
        self._airtime_s = 0.0
        self._share = 0.0

    def read(self, statistics: RadioStatistics, now_s: float) -> ChannelUse:
        passed_s = now_s - self._since_s
        if passed_s >= AIRTIME_WINDOW_S:
            self._share = (statistics.airtime_s - self._airtime_s) / passed_s
            self._since_s, self._airtime_s = now_s, statistics.airtime_s
        return ChannelUse(
            self._share, statistics.tries_per_packet, statistics.waiting, statistics.lost
        )


class Quality(NamedTuple):
    """Quality of one link: moving averages over recent packets."""

    tries: float  # per packet, delivered or not; those included that the radio made by itself
    delivered: float  # share, 0..1


class LinkQuality:
    """One thread writes, any thread reads: the figures are replaced, never modified."""

    def __init__(self) -> None:
        self.figures: Mapping[int, Quality] = {}  # for each neighbour that packets were sent to

    def packet(self, neighbour: int, tries: int, delivered: bool) -> None:
        """A packet to a neighbour was delivered or given up, after `tries`."""
        before = self.figures.get(neighbour)
        latest = Quality(float(tries), float(delivered))
        if before is not None:
            latest = Quality(*(old + _LEARNING * (new - old) for old, new in zip(before, latest)))
        self.figures = {**self.figures, neighbour: latest}
