"""FlightNews: flights of a node's group, as announced (docs/repair.md, "Negotiation")."""

from __future__ import annotations

import math

from drone_mesh.drone.location import Location


class FlightNews:
    """Which drones took off, and where they looked for the gateway."""

    drone_flew = False  # one of the group, since the connection was lost

    def __init__(self) -> None:
        self._quiet_until_s = -math.inf
        self._tries: dict[Location, float] = {}  # gateway's place -> when another may fly there
        self._failures: set[tuple[int, Location | None]] = set()  # that were reported
        self._failed_s: dict[int, float] = {}  # node -> when it reported a failed flight there

    def took_off(self, quiet_until_s: float) -> None:
        """A drone takes off: the others wait for its outcome until `quiet_until_s`."""
        self.drone_flew = True
        self._quiet_until_s = quiet_until_s

    def is_quiet(self, now_s: float) -> bool:
        """Whether the group waits for a drone in flight."""
        return now_s < self._quiet_until_s

    def tries(self, place: Location | None, now_s: float, keep_s: float) -> None:
        """A drone looks or looked for the gateway at `place`; no other flies there for `keep_s`."""
        self._tries = {tried: at_s for tried, at_s in self._tries.items() if now_s < at_s}
        if place is not None:
            until_s = now_s + keep_s
            self._tries[place] = max(until_s, self._tries.get(place, until_s))

    def failed(self, node: int, place: Location | None, now_s: float, keep_s: float) -> None:
        """Note that `node` found no gateway at `place`. Repetitions in later rounds are ignored."""
        if (node, place) not in self._failures:
            self._failures.add((node, place))
            self.tries(place, now_s, keep_s)

    def is_tried(self, place: Location, now_s: float, near_m: float) -> bool:
        """Whether a drone has been so close to `place` that a gateway there would have answered."""
        return any(
            now_s < until_s and place.distance_m(tried) < near_m
            for tried, until_s in self._tries.items()
        )

    def is_new_failure(self, node: int, now_s: float, again_s: float) -> bool:
        """Record a failed flight of `node`; returns whether it is the first within `again_s`."""
        is_new = now_s >= self._failed_s.get(node, -math.inf) + again_s
        if is_new:
            self._failed_s[node] = now_s
        return is_new

    def clear(self) -> None:
        """A gateway answers: places tried without success may be tried again."""
        self.drone_flew = False
        self._quiet_until_s = -math.inf
        self._tries.clear()
        self._failures.clear()
