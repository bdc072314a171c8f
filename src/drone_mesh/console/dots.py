"""PacketDots: packets on their way to a page, which draws each as a dot moving along a link."""

from __future__ import annotations

import json
from array import array
from typing import Iterable, Iterator, NamedTuple, Sequence

from drone_mesh.state.packets import MOST_SAMPLED, kind_of

MOST_WAITING = 2 * MOST_SAMPLED  # of a page that falls behind, only the newest are drawn


class Dot(NamedTuple):
    """One packet."""

    sender: int  # of this hop
    receiver: int
    type: int  # byte 2
    age_s: float  # wall seconds since it arrived


def make_dots(senders: bytes, receivers: bytes, types: bytes, ages_s: Iterable[float]) -> list[Dot]:
    """The packets of a sample, given as columns; each byte is an id or a type."""
    return [Dot(*packet) for packet in zip(senders, receivers, types, ages_s)]


class RecordedDots(NamedTuple):
    """A sample of packets in a recording: an hour has millions, so they are packed."""

    stamp_s: float  # simulated
    carried: int  # packets that arrived since the previous sample
    packets: bytes  # of each packet in the sample: sender, receiver, type
    ages_s: Sequence[float]  # of each: seconds since it arrived

    @classmethod
    def pack(cls, stamp_s: float, carried: int, dots: Sequence[Dot]) -> RecordedDots:
        """Pack the packets of a sample."""
        packets = bytes(byte for dot in dots for byte in dot[:3])
        return cls(stamp_s, carried, packets, array("f", (dot.age_s for dot in dots)))

    def dots(self, age_s: float) -> list[Dot]:
        """The packets, as dots that appear this many seconds after the sample."""
        senders, receivers, types = (self.packets[field::3] for field in range(3))
        return make_dots(senders, receivers, types, (age + age_s for age in self.ages_s))


class PacketDots:
    """The packets not yet sent to one page. Belongs to the server's event loop."""

    def __init__(self) -> None:
        self.wanted = False  # the page draws them
        self._carried = 0
        self._waiting: list[Dot] = []

    def add(self, carried: int, dots: Sequence[Dot]) -> None:
        """`carried` packets arrived; `dots` are a sample of them."""
        if self.wanted:
            self._carried += carried
            self._waiting = [*self._waiting, *dots][-MOST_WAITING:]

    def clear(self) -> None:
        """Drop the packets not yet sent: the page now shows another moment."""
        self._carried, self._waiting = 0, []

    def messages(self) -> Iterator[str]:
        """New packets for the page, as JSON."""
        carried, waiting = self._carried, self._waiting
        self.clear()
        if carried:
            dots = [
                [dot.sender, dot.receiver, kind_of(dot.type).value, round(dot.age_s, 3)]
                for dot in waiting
            ]
            yield json.dumps({"type": "packets", "carried": carried, "dots": dots})
