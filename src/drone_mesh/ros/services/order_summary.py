"""OrderSummary: the outcome of the orders of a layout."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping, Sequence

from drone_mesh.drone.fleet import drones_in_words


@dataclass(frozen=True)
class OrderSummary:
    """Ids of the drones of a layout, by the outcome of their orders."""

    sent: Sequence[int]
    no_route: Sequence[int]
    not_in_fleet: Sequence[int]
    refused: Mapping[int, str] = field(default_factory=dict)  # by drone: the reason
    later: Sequence[int] = ()
    there: Sequence[int] = ()
    flying: Sequence[int] = ()  # to their places, since before the order

    @property
    def is_complete(self) -> bool:
        """Whether nobody is left without the order."""
        return not (self.no_route or self.not_in_fleet or self.refused)

    def in_words(self) -> str:
        """One line, for example: ordered 16 of 17 drones; drone 17 is not in this fleet."""
        others = self.no_route, self.not_in_fleet, self.refused, self.later, self.there, self.flying
        total = len(self.sent) + sum(map(len, others))
        parts = [f"ordered {len(self.sent)} of {total} drone{'' if total == 1 else 's'}"]
        if self.there:
            verb, noun = ("is", "its place") if len(self.there) == 1 else ("are", "their places")
            parts.append(f"{drones_in_words(self.there)} {verb} at {noun}")
        if self.flying:
            verb = "flies" if len(self.flying) == 1 else "fly"
            parts.append(f"{drones_in_words(self.flying)} {verb} there already")
        if self.later:
            parts.append(f"{drones_in_words(self.later)} will set out later")
        if self.no_route:
            parts.append(f"no route yet to {drones_in_words(self.no_route)}")
        parts += [f"drone {drone} stays: {reason}" for drone, reason in self.refused.items()]
        if self.not_in_fleet:
            verb = "is" if len(self.not_in_fleet) == 1 else "are"
            parts.append(f"{drones_in_words(self.not_in_fleet)} {verb} not in this fleet")
        return "; ".join(parts)
