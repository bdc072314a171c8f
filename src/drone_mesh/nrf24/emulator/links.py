"""Link models: the strength of a received frame, and its number of wrong bits.

Models may be scaled: a world of a few metres can have a radio whose range ends where that of the
ideal disc would, without changing the behaviour near the edge. One is the range measured in 2019
with real modules.
"""

from __future__ import annotations

import abc
import csv
import math
import random
from collections import defaultdict
from pathlib import Path
from typing import Callable, Hashable, NamedTuple

from drone_mesh.nrf24.registers import NS_PER_S, failed_cycle_ns
from drone_mesh.nrf24.settings import RadioSettings

SENSITIVITY_DBM = {250_000: -94.0, 1_000_000: -85.0, 2_000_000: -82.0}  # at 0.1 % BER [DS 5.7]
_FSPL_CONSTANT_DB = -27.55  # free space, metres and MHz (ITU-R P.525)
OUTDOORS = 2.7  # exponent of the path loss near the ground
_NEAREST_M = 0.1  # antennas may share a point; log10(0) may not
_ADDRESS_LOST_BER = 0.1  # with more wrong bits not even the address is recognised
_SAME_POINT_DBM = 0.0  # the strongest specified input [DS 5.7]


class Hop(NamedTuple):
    """The path of one frame to one receiver."""

    sender: Hashable
    receiver: Hashable
    distance_m: float
    power_dbm: float  # at the receiver
    bits_per_s: int
    bit_count: int
    packet: object  # the same object for each attempt to send one packet; None: acknowledgement
    start_ns: int = 0  # when the frame began


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


def free_space_dbm(distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
    """Power between isotropic antennas (ITU-R P.525); 40.06 dB loss over 1 m at 2401 MHz."""
    distance_m = max(distance_m, _NEAREST_M)
    loss_db = 20 * math.log10(distance_m) + 20 * math.log10(carrier_mhz) + _FSPL_CONSTANT_DB
    return min(tx_dbm - loss_db, _SAME_POINT_DBM)


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


def bit_error_rate(margin_db: float) -> float:
    """Share of wrong bits at this margin above the sensitivity; 0.1 % at 0 dB, as specified."""
    return 0.5 * math.exp(-6.215 * 10 ** (margin_db / 10))


class LogDistance(LinkModel):
    """Power falls with a power of the distance; bits are damaged near the sensitivity limit."""

    def __init__(
        self,
        rng: random.Random,
        *,
        exponent: float = OUTDOORS,
        gain_db: float = 0.0,
        metres_per_metre: float = 1.0,
    ) -> None:
        """`gain_db`: of both antennas and amplifiers; `metres_per_metre`: see with_edge_at."""
        self._rng = rng
        self._exponent = exponent
        self._gain_db = gain_db
        self.metres_per_metre = metres_per_metre

    @classmethod
    def with_edge_at(
        cls,
        range_m: float,
        rng: random.Random,
        *,
        exponent: float = OUTDOORS,
        bits_per_s: int = 250_000,
    ) -> LogDistance:
        """Scale distances so that at `range_m` the power equals the sensitivity at that rate.

        At that distance about one frame in four sent with 0 dBm is lost.
        """
        model = cls(rng, exponent=exponent)
        at_1_m_dbm = model.received_dbm(1.0, 0.0, 2401)
        edge_m = 10 ** ((at_1_m_dbm - SENSITIVITY_DBM[bits_per_s]) / (10 * exponent))
        return cls(rng, exponent=exponent, metres_per_metre=edge_m / range_m)

    def received_dbm(self, distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
        at_1_m_dbm = free_space_dbm(1.0, tx_dbm + self._gain_db, carrier_mhz)
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


class LossCurve(LinkModel):
    """Packets are lost as often as measured at each distance.

    The measurements are the share of packets that were lost after 16 frames, and the duration of a
    packet. Independent losses cannot explain both: they would have to be so frequent that every
    packet took long. So there are two kinds of loss here. A link fails for `BURST_S` at a time, as
    often as packets were lost: such a burst loses all frames of one transaction of the chip, and a
    retry after a pause meets a new state of the link. Between the bursts, single frames are lost,
    just often enough to explain the rest of the measured durations. Acknowledgements of received
    packets are not lost. Beyond the last distance nothing was measured and nothing arrives; below
    the first, its shares apply.
    """

    BURST_S = 0.05  # just longer than 16 frames at 250 kbit/s

    def __init__(
        self,
        points: tuple[tuple[float, float], ...],
        rng: random.Random,
        *,
        frame_points: tuple[tuple[float, float], ...] = ((0.0, 0.0),),
        metres_per_metre: float = 1.0,
    ) -> None:
        """`points`: distance in metres and share of lost packets, by rising distance.

        `frame_points`: the same for single frames between the bursts.
        """
        for curve in (points, frame_points):
            if not curve or any(b[0] <= a[0] for a, b in zip(curve, curve[1:])):
                raise ValueError("a loss curve needs points of rising distance")
        self._points = points
        self._frame_points = frame_points
        self._rng = rng
        self._scale = metres_per_metre
        self._fates: dict[tuple[Hashable, Hashable], tuple[object, int, bool]] = {}

    def loss(self, distance_m: float) -> float | None:
        """Share of lost packets, linear between the points; None: out of range."""
        metres = distance_m * self._scale
        if metres > self._points[-1][0]:
            return None
        return _between(self._points, metres)

    def frame_loss(self, distance_m: float) -> float:
        """Share of single frames lost between the bursts."""
        return _between(self._frame_points, distance_m * self._scale)

    def received_dbm(self, distance_m: float, tx_dbm: float, carrier_mhz: int) -> float:
        return free_space_dbm(distance_m * self._scale, tx_dbm, carrier_mhz)

    def bit_errors(self, hop: Hop) -> int | None:
        loss = self.loss(hop.distance_m)
        if loss is None:
            return None
        if hop.packet is None:
            return 0
        link = (hop.sender, hop.receiver)
        packet, until_ns, lost = self._fates.get(link, (None, 0, False))
        if packet is not hop.packet or hop.start_ns >= until_ns:
            lost = self._rng.random() < loss
            until_ns = hop.start_ns + round(self.BURST_S * NS_PER_S)
            self._fates[link] = (hop.packet, until_ns, lost)
        if lost or self._rng.random() < self.frame_loss(hop.distance_m):
            return None
        return 0

    def reaches(self, distance_m: float, power_dbm: float, bits_per_s: int) -> bool:
        return self.loss(distance_m) is not None


def _between(points: tuple[tuple[float, float], ...], metres: float) -> float:
    """Linear between the points; constant before the first and after the last."""
    last_m, last_value = points[0]
    for point_m, value in points:
        if metres <= point_m:
            if point_m == last_m:
                return value
            part = (metres - last_m) / (point_m - last_m)
            return last_value + max(part, 0.0) * (value - last_value)
        last_m, last_value = point_m, value
    return last_value


RANGE_FILE = Path(__file__).with_name("nrf24_range.csv")
_PACKETS_PER_RUN = 1000
_NEAR_M = 300.0  # up to this distance the throughput was constant


def measured_losses(path: Path = RANGE_FILE) -> tuple[tuple[float, float], ...]:
    """Distance in metres and mean share of packets lost after all retries."""
    return tuple(
        (distance_m, lost / _PACKETS_PER_RUN)
        for distance_m, lost in _means(path, "packets_lost_of_1000")
    )


def measured_frame_losses(path: Path = RANGE_FILE) -> tuple[tuple[float, float], ...]:
    """Distance in metres and the additional share of lost single frames.

    Derived from the throughput: packets took longer than near ones. Lost packets took the 16 frames
    of their bursts; the rest are retransmissions of packets that arrived.
    """
    settings = RadioSettings(crc_bytes=1)  # of 2019
    frame_ns = round(settings.frame_s * NS_PER_S)
    ard_ns = (settings.retransmit_delay + 1) * 250_000
    failed_s = failed_cycle_ns(frame_ns, ard_ns, settings.retransmits) / NS_PER_S
    retry_s = failed_cycle_ns(frame_ns, ard_ns, 1) / NS_PER_S / 2
    losses = dict(measured_losses(path))
    throughputs = _means(path, "throughput_kbit_s")
    near = [kbit_s for distance_m, kbit_s in throughputs if distance_m <= _NEAR_M]
    near_kbit_s = sum(near) / len(near)
    near_loss = sum(losses[m] for m, _ in throughputs if m <= _NEAR_M) / len(near)
    near_s = (1 - near_loss) * settings.acknowledged_s + near_loss * failed_s
    points = []
    for distance_m, kbit_s in throughputs:
        lost = losses[distance_m]
        packet_s = near_s * near_kbit_s / kbit_s
        left_s = packet_s - (1 - lost) * settings.acknowledged_s - lost * failed_s
        retries = max(left_s, 0.0) / (1 - lost) / retry_s
        points.append((distance_m, retries / (1 + retries)))
    return tuple(points)


def measured_curve(rng: random.Random, *, range_m: float | None = None) -> LossCurve:
    """The measured modules; with `range_m`, scaled so that their range ends there."""
    points = measured_losses()
    scale = 1.0 if range_m is None else points[-1][0] / range_m
    return LossCurve(points, rng, frame_points=measured_frame_losses(), metres_per_metre=scale)


def _means(path: Path, column: str) -> list[tuple[float, float]]:
    values: defaultdict[float, list[float]] = defaultdict(list)
    with path.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            values[float(row["distance_m"])].append(float(row[column]))
    return [(distance_m, sum(found) / len(found)) for distance_m, found in sorted(values.items())]
