"""PacketDots: packets on their way to a page, which draws each as a dot that runs along a link."""

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
    """What one page has not been sent yet. Belongs to the server's event loop."""

    def __init__(self) -> None:
        self.wanted = False  # the page draws them
        self._carried = 0
        self._waiting: list[Dot] = []

    def add(self, carried: int, dots: Sequence[Dot]) -> None:
        """So many packets arrived; `dots` are a sample of them."""
        if self.wanted:
            self._carried += carried
            self._waiting = [*self._waiting, *dots][-MOST_WAITING:]

    def messages(self, is_live: bool) -> Iterator[str]:
        """What is new for the page, as JSON; nothing for a page that looks at the past."""
        carried, waiting = self._carried, self._waiting
        self._carried, self._waiting = 0, []
        if is_live and carried:
            dots = [
                [dot.sender, dot.receiver, kind_of(dot.type).value, round(dot.age_s, 3)]
                for dot in waiting
            ]
            yield json.dumps({"type": "packets", "carried": carried, "dots": dots})
