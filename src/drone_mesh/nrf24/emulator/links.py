"""Link models: the strength of a received frame, and its number of wrong bits.

Models may be scaled: a world of a few metres can have a radio whose range ends where that of the
ideal disc would, without changing the behaviour near the edge.
"""

from __future__ import annotations

import abc
import csv
import math
import random
from collections import defaultdict
from pathlib import Path
from statistics import fmean
from typing import Callable, Final, Hashable

from drone_mesh.compiled import mypyc_attr

SENSITIVITY_DBM = {250_000: -94.0, 1_000_000: -85.0, 2_000_000: -82.0}  # at 0.1 % BER [DS 5.7]
_FSPL_CONSTANT_DB: Final = -27.55  # free space, metres and MHz (ITU-R P.525)
OUTDOORS = 2.7  # exponent of the path loss near the ground
_NEAREST_M: Final = 0.1  # antennas may share a point; log10(0) may not
_ADDRESS_LOST_BER = 0.1  # with more wrong bits not even the address is recognised
_SAME_POINT_DBM: Final = 0.0  # the strongest specified input [DS 5.7]


class Hop:
    """The path of one frame to one receiver.

    `power_dbm` is at the receiver; `packet` the same object for each attempt to send it, and None
    for an acknowledgement; the frame began at `start_ns`.
    """

    def __init__(
        self,
        sender: Hashable,
        receiver: Hashable,
        distance_m: float,
        power_dbm: float,
        bits_per_s: int,
        bit_count: int,
        packet: object,
        start_ns: int = 0,
    ) -> None:
        self.sender, self.receiver = sender, receiver
        self.distance_m, self.power_dbm = distance_m, power_dbm
        self.bits_per_s, self.bit_count = bits_per_s, bit_count
        self.packet, self.start_ns = packet, start_ns


@mypyc_attr(allow_interpreted_subclasses=True)
class LinkModel(abc.ABC):
    """The effect of the space between two antennas on frames."""

    @abc.abstractmethod
    def received_dbm(self, distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
        """Power at the receiver; decides which overlapping frame survives, and RPD."""

    @abc.abstractmethod
    def bit_errors(self, hop: Hop) -> int | None:
        """The number of wrong bits; None: the receiver does not notice the frame at all."""

    def reaches(self, distance_m: float, power_dbm: float, bits_per_s: int) -> bool:
        """Whether a frame can arrive over that distance at all; True if unknown."""
        return True

    def furthest_m(self, tx_dbm: float, carrier_mhz: int, bits_per_s: int, more_db: float) -> float:
        """From further away no frame arrives, even with `more_db` than usual; infinity: unknown."""
        return math.inf


_log10: Final = math.log10


def free_space_dbm(distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
    """Power between isotropic antennas (ITU-R P.525); 40.06 dB loss over 1 m at 2401 MHz."""
    distance_m = max(distance_m, _NEAREST_M)
    loss_db = 20 * _log10(distance_m) + 20 * _log10(carrier_mhz) + _FSPL_CONSTANT_DB
    return min(tx_dbm - loss_db, _SAME_POINT_DBM)


@mypyc_attr(allow_interpreted_subclasses=True)
class IdealDisc(LinkModel):
    """All frames arrive within the range, none beyond it."""

    def __init__(self, range_m: float = math.inf) -> None:
        self._range_m = range_m

    def received_dbm(self, distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
        return free_space_dbm(distance_m, tx_dbm, carrier_mhz)

    def bit_errors(self, hop: Hop) -> int | None:
        return 0 if hop.distance_m < self._range_m else None

    def reaches(self, distance_m: float, power_dbm: float, bits_per_s: int) -> bool:
        return distance_m < self._range_m

    def furthest_m(self, tx_dbm: float, carrier_mhz: int, bits_per_s: int, more_db: float) -> float:
        return self._range_m


def bit_error_rate(margin_db: float) -> float:
    """Share of wrong bits at this margin above the sensitivity; 0.1 % at 0 dB, as specified."""
    return 0.5 * math.exp(-6.215 * 10 ** (margin_db / 10))


_LEAST_MARGIN_DB = 10 * math.log10(math.log(0.5 / _ADDRESS_LOST_BER) / 6.215)  # its inverse


@mypyc_attr(allow_interpreted_subclasses=True)
class LogDistance(LinkModel):
    """Power falls with a power of the distance; bits are damaged near the sensitivity limit."""

    def __init__(
        self,
        rng: random.Random,
        *,
        exponent: float = OUTDOORS,
        metres_per_metre: float = 1.0,
    ) -> None:
        """`metres_per_metre`: see with_edge_at."""
        self._rng = rng
        self._exponent = exponent
        self.metres_per_metre = metres_per_metre

    @classmethod
    def with_edge_at(
        cls, range_m: float, rng: random.Random, *, bits_per_s: int = 250_000
    ) -> LogDistance:
        """Scale distances so that at `range_m` the power equals the sensitivity at that rate.

        At that distance about one frame in four sent with 0 dBm is lost.
        """
        at_1_m_dbm = free_space_dbm(1.0, 0.0, 2401)
        edge_m = 10 ** ((at_1_m_dbm - SENSITIVITY_DBM[bits_per_s]) / (10 * OUTDOORS))
        return cls(rng, metres_per_metre=edge_m / range_m)

    def received_dbm(self, distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
        at_1_m_dbm = free_space_dbm(1.0, tx_dbm, carrier_mhz)
        metres = max(distance_m * self.metres_per_metre, _NEAREST_M)
        return min(at_1_m_dbm - 10 * self._exponent * math.log10(metres), _SAME_POINT_DBM)

    def bit_errors(self, hop: Hop) -> int | None:
        rate = bit_error_rate(hop.power_dbm - SENSITIVITY_DBM[hop.bits_per_s])
        if rate < 1e-12:
            return 0
        if rate > _ADDRESS_LOST_BER:
            return None  # not even the address is found
        if self._rng.random() < (1 - rate) ** hop.bit_count:
            return 0
        return max(1, round(rate * hop.bit_count))

    def reaches(self, distance_m: float, power_dbm: float, bits_per_s: int) -> bool:
        return bit_error_rate(power_dbm - SENSITIVITY_DBM[bits_per_s]) <= _ADDRESS_LOST_BER

    def furthest_m(self, tx_dbm: float, carrier_mhz: int, bits_per_s: int, more_db: float) -> float:
        spare_db = free_space_dbm(1.0, tx_dbm, carrier_mhz) + more_db
        spare_db -= SENSITIVITY_DBM[bits_per_s] + _LEAST_MARGIN_DB
        return float(10 ** (spare_db / (10 * self._exponent)) / self.metres_per_metre)


@mypyc_attr(allow_interpreted_subclasses=True)
class ScriptedLoss(LinkModel):
    """Another model with additional losses on demand, for tests and experiments."""

    def __init__(self, model: LinkModel, loses: Callable[[Hop], bool]) -> None:
        self._model = model
        self._loses = loses

    def received_dbm(self, distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
        return self._model.received_dbm(distance_m, tx_dbm, carrier_mhz)

    def bit_errors(self, hop: Hop) -> int | None:
        return None if self._loses(hop) else self._model.bit_errors(hop)

    def reaches(self, distance_m: float, power_dbm: float, bits_per_s: int) -> bool:
        return self._model.reaches(distance_m, power_dbm, bits_per_s)

    def furthest_m(self, tx_dbm: float, carrier_mhz: int, bits_per_s: int, more_db: float) -> float:
        return self._model.furthest_m(tx_dbm, carrier_mhz, bits_per_s, more_db)


_RANGE_FILE = Path(__file__).with_name("nrf24_range.csv")
_PACKETS_PER_RUN = 1000


def measured_losses() -> list[tuple[float, float]]:
    """Of the modules of 2019: distance in metres, mean share of packets lost after 16 frames."""
    lost: defaultdict[float, list[float]] = defaultdict(list)
    with _RANGE_FILE.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            lost[float(row["distance_m"])].append(float(row["packets_lost_of_1000"]))
    return [(m, fmean(packets) / _PACKETS_PER_RUN) for m, packets in sorted(lost.items())]
