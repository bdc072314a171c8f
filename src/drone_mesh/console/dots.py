"""PacketDots: packets on their way to a page, which draws each as a dot moving along a link."""

from __future__ import annotations

import json
from typing import Iterator, NamedTuple, Sequence

from drone_mesh.state.packets import MOST_SAMPLED, kind_of

MOST_WAITING = 2 * MOST_SAMPLED  # of a page that falls behind, only the newest are drawn


class Dot(NamedTuple):
    """One packet."""

    sender: int  # of this hop
    receiver: int
    type: int  # byte 2
    age_s: float  # wall seconds since it arrived


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

    def messages(self, is_live: bool) -> Iterator[str]:
        """New packets for the page, as JSON; none for a page that shows the past."""
        carried, waiting = self._carried, self._waiting
        self._carried, self._waiting = 0, []
        if is_live and carried:
            dots = [
                [dot.sender, dot.receiver, kind_of(dot.type).value, round(dot.age_s, 3)]
                for dot in waiting
            ]
            yield json.dumps({"type": "packets", "carried": carried, "dots": dots})
