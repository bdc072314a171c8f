"""OwnMotion: where this node is, and its velocity over the last seconds."""

from __future__ import annotations

import math
from collections import deque
from typing import Callable

from drone_mesh.communication.beacon.packets import Motion
from drone_mesh.drone.location import Location

OVER_S = 2.0  # noise of a receiver and turns of a drone cancel out
TURN_S = 0.5  # only so long before a turn is noticed count samples for the new velocity
STANDS_S = 10.0  # a drone that has not moved for this long stands
REGION_M = 256.0  # far less than the distance up to which a beacon tells its place
AGAIN_S = 0.1  # a receiver for satellites gives ten positions per second


class OwnMotion:
    """Samples the position of one node whenever it is asked."""

    def __init__(self, locate: Callable[[], Location | None], step_m: float) -> None:
        """A node that moved less than `step_m` counts as standing: positions have errors."""
        self._locate = locate
        self._step_m = step_m
        self._anchor: Location | None = None
        self.region: Location | None = None  # about where it is: the same for most nodes near it
        self._moved_s = -math.inf
        self._samples: deque[tuple[float, Location]] = deque()
        self._motion: Motion | None = None
        self._asked_s = -AGAIN_S
        self._least_s = OVER_S / 2

    def stands(self, now_s: float) -> bool:
        """Whether it is at rest, as far as it knows its place."""
        return now_s - self._moved_s >= STANDS_S

    def has_turned(self, now_s: float) -> None:
        """Forget the velocity: the node is not where that led."""
        self._least_s = TURN_S
        while self._samples and now_s - self._samples[0][0] > TURN_S:
            self._samples.popleft()

    def at(self, now_s: float) -> Motion | None:
        """Position and velocity now; None while the position is unknown."""
        if now_s - self._asked_s < AGAIN_S:
            return self._motion
        self._asked_s = now_s
        place = self._locate()
        if place is None:
            self._samples.clear()
            self._motion = self.region = None
            return None
        if self._anchor is None or self._anchor.distance_m(place) > self._step_m:
            self._moved_s = -math.inf if self._anchor is None else now_s
            self._anchor = place
            self.region = None
        if self.region is None:
            self.region = Location(*(REGION_M * round(value / REGION_M) for value in place))
        samples = self._samples
        samples.append((now_s, place))
        while now_s - samples[1][0] >= OVER_S if len(samples) > 1 else False:
            samples.popleft()
        since_s, before = samples[0]
        seconds = max(now_s - since_s, self._least_s)  # a short time would exaggerate the noise
        self._motion = Motion(
            place,
            (
                (place.latitude - before.latitude) / seconds,
                (place.longitude - before.longitude) / seconds,
                (place.height - before.height) / seconds,
            ),
        )
        return self._motion
