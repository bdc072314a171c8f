"""Observations of the probe, and what follows from them about the start of a fleet."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Iterable, Union

from drone_mesh.communication.observer import MeshEventKind

STARTED = MeshEventKind.STARTED.value
CONNECTED = MeshEventKind.CONNECTED.value
DISCONNECTED = MeshEventKind.DISCONNECTED.value

PROBE = "bench_probe"  # it announces itself with empty figures

# Orders to the probe: watch the state of the mesh, rest, send all drones on a flight.
WATCH, REST, TAKE_OFF = "watch", "rest", "take off"


@dataclass(frozen=True)
class StateSample:
    """One MeshState as numbers."""

    wall_s: float  # when it arrived, time.monotonic
    sim_s: float  # its stamp
    on: int  # nodes with power
    connected: int  # routers with power and a gateway
    messages: int  # sum of total_messages over all nodes
    flying: int  # drones
    links: int  # pairs of neighbours


@dataclass(frozen=True)
class Happening:
    """A node started, was connected or lost its connection."""

    sim_s: float
    node: int
    kind: str


@dataclass(frozen=True)
class Figures:
    """Measurements that a part of the system publishes about itself, by name."""

    of: str
    wall_s: float  # when they arrived, time.monotonic
    values: dict[str, float] = field(default_factory=dict)


Sight = Union[StateSample, Happening, Figures]
_KINDS = {kind.__name__: kind for kind in (StateSample, Happening, Figures)}


def to_line(sight: Sight) -> str:
    """An observation as one line of text, for the pipe between probe and benchmark."""
    return json.dumps({"sight": type(sight).__name__, **asdict(sight)})


def from_line(line: str) -> Sight:
    """The observation in a line of `to_line`. Raises ValueError for any other line."""
    try:
        fields = json.loads(line)
        sight: Sight = _KINDS[fields.pop("sight")](**fields)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"invalid line of the probe: {line[:80]!r}") from error
    return sight


class Watch:
    """Collects the observations of one fleet. Belongs to one thread."""

    def __init__(self, drones: int) -> None:
        self._drones = drones
        self._happenings: list[Happening] = []
        self.samples: list[StateSample] = []
        self.figures: dict[str, Figures] = {}  # the latest, by source
        self.worst: dict[str, float] = {}  # the largest value of each figure, from any source
        self.all_on: StateSample | None = None  # the first sample with all nodes on
        self.all_connected: StateSample | None = None

    def see(self, sight: Sight) -> None:
        """Add an observation."""
        if isinstance(sight, Happening):
            self._happenings.append(sight)
        elif isinstance(sight, Figures):
            self.figures[sight.of] = sight
            for name, value in sight.values.items():
                self.worst[name] = max(value, self.worst.get(name, -math.inf))
        else:
            self.samples.append(sight)
            if self.all_on is None and sight.on == self._drones:
                self.all_on = sight
            if self.all_on and not self.all_connected and sight.connected == self._drones - 1:
                self.all_connected = sight

    @property
    def last(self) -> StateSample | None:
        """The latest sample, or None."""
        return self.samples[-1] if self.samples else None

    def connected_after_s(self) -> float | None:
        """Simulated seconds from the start of the last node until all were connected; None: never.

        Uses the stamps of the events if they are complete. If the probe subscribed too late for
        some, uses the stamps of the states.
        """
        if self.all_on is None or self.all_connected is None:
            return None
        started = {h.node: h.sim_s for h in self._happenings if h.kind == STARTED}
        connected_s = first_time_all_connected(self._happenings, self._drones - 1)
        if len(started) == self._drones and connected_s is not None:
            return max(0.0, connected_s - max(started.values()))
        return self.all_connected.sim_s - self.all_on.sim_s

    def disconnected_since(self, sim_s: float) -> int:
        """How many times a node lost its connection after `sim_s`, according to the events."""
        return sum(h.kind == DISCONNECTED and h.sim_s > sim_s for h in tuple(self._happenings))

    def total(self, name: str) -> float | None:
        """The sum of a figure over all sources; None: no source publishes it."""
        values = [figures.values[name] for figures in self._sources_of(name)]
        return sum(values) if values else None

    def received_s(self, name: str) -> float:
        """When the latest value in `total` arrived, time.monotonic; 0: never."""
        return max((figures.wall_s for figures in self._sources_of(name)), default=0.0)

    def _sources_of(self, name: str) -> list[Figures]:
        return [figures for figures in self.figures.values() if name in figures.values]


def first_time_all_connected(happenings: Iterable[Happening], routers: int) -> float | None:
    """The simulated second at which `routers` were connected at once; None: never."""
    connected = set()
    for happening in sorted(happenings, key=lambda happening: happening.sim_s):
        if happening.kind == CONNECTED:
            connected.add(happening.node)
        elif happening.kind == DISCONNECTED:
            connected.discard(happening.node)
        if len(connected) == routers:
            return happening.sim_s
    return None
