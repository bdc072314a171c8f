"""OrderSummary: what became of the orders of a layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence


@dataclass(frozen=True)
class OrderSummary:
    """Ids of the drones of a layout, by what became of their orders."""

    sent: Sequence[int]
    no_route: Sequence[int]
    not_in_fleet: Sequence[int]

    def in_words(self) -> str:
        """One line, for example: ordered 16 of 17 drones; drone 17 is not in this fleet."""
        total = len(self.sent) + len(self.no_route) + len(self.not_in_fleet)
        parts = [f"ordered {len(self.sent)} of {_counted(total, 'drone')}"]
        if self.no_route:
            parts.append(f"no route to {_named(self.no_route)}")
        if self.not_in_fleet:
            verb = "is" if len(self.not_in_fleet) == 1 else "are"
            parts.append(f"{_named(self.not_in_fleet)} {verb} not in this fleet")
        return "; ".join(parts)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _named(ids: Sequence[int]) -> str:
    """drone 3; drones 3, 5..9."""
    runs: list[list[int]] = []
    for node_id in sorted(ids):
        if runs and node_id == runs[-1][1] + 1:
            runs[-1][1] = node_id
        else:
            runs.append([node_id, node_id])
    words = [str(a) if a == b else f"{a}..{b}" for a, b in runs]
    return f"drone{'' if len(ids) == 1 else 's'} {', '.join(words)}"
