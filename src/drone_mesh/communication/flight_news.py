"""FlightNews: what a node heard of the flights of its group (docs/protocol.md, "Negotiation")."""

from __future__ import annotations

import math

from drone_mesh.drone.interfaces import Location


class FlightNews:
    """Which drones took off, and where one looked for the gateway."""

    def __init__(self) -> None:
        self._quiet_until_s = -math.inf
        self._tries: dict[Location, float] = {}  # gateway's place -> when another one may fly there
        self._in_vain_s: dict[int, float] = {}  # node -> when it said that it found none there

    def took_off(self, quiet_until_s: float) -> None:
        """A drone flies: until then the others wait for the outcome."""
        self._quiet_until_s = quiet_until_s

    def is_quiet(self, now_s: float) -> bool:
        """Whether the group waits for a drone in flight."""
        return now_s < self._quiet_until_s

    def tries(self, place: Location | None, now_s: float, keep_s: float) -> None:
        """A drone looks, or looked, for the gateway at `place`; no other one does for `keep_s`."""
        self._tries = {tried: at_s for tried, at_s in self._tries.items() if now_s < at_s}
        if place is not None:
            until_s = now_s + keep_s
            self._tries[place] = max(until_s, self._tries.get(place, until_s))

    def is_tried(self, place: Location, now_s: float, near_m: float) -> bool:
        """Whether a drone looked so near to `place` that a gateway there would have answered."""
        return any(
            now_s < until_s and place.distance_m(tried) < near_m
            for tried, until_s in self._tries.items()
        )

    def is_new_in_vain(self, node: int, now_s: float, again_s: float) -> bool:
        """Whether `node` has not reported a flight without success within `again_s`; now it did."""
        is_new = now_s >= self._in_vain_s.get(node, -math.inf) + again_s
        if is_new:
            self._in_vain_s[node] = now_s
        return is_new

    def clear(self) -> None:
        """A gateway answers: places tried without success may be tried again."""
        self._quiet_until_s = -math.inf
        self._tries.clear()
