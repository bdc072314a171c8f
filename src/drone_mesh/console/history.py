"""History: recorded states and events of a run; for a live run, the last 30 minutes."""

from __future__ import annotations

import bisect
import json
import math
import zlib
from dataclasses import fields, replace
from typing import Any, Iterable, NamedTuple, Sequence

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.console.dots import RecordedDots
from drone_mesh.state.model import AreaStatus, EventRecord, MeshStatus, NodeStatus, ObstacleStatus
from drone_mesh.state.outages import MeshSample, take_sample

KEPT_S = 1800.0  # simulated
KEPT_BYTES = 64_000_000  # 254 nodes with 200 neighbours each need some 20 kB per state
PERIOD_S = 0.4  # wall, between two states of a live run
MOST_MARKS = 400
_OF_BYTES = [at for at, field in enumerate(fields(NodeStatus)) if field.default == b""]
_MARKED = {
    MeshEventKind.POWER_OFF.value: "off",
    MeshEventKind.POWER_ON.value: "on",
    MeshEventKind.DISCONNECTED.value: "lost",
    MeshEventKind.FLIGHT_DECIDED.value: "flight",
}


class KeptState(NamedTuple):
    """A state in its compressed form, and what charts show of it."""

    stamp_s: float
    packed: bytes
    sample: MeshSample


def packed(mesh: MeshStatus) -> bytes:
    """A state in a compressed form. Any thread."""
    return zlib.compress(json.dumps(mesh, default=_plain, separators=(",", ":")).encode(), 1)


def unpacked(state: bytes) -> MeshStatus:
    """The state in such a compressed form. Any thread. Raises TypeError or ValueError."""
    mesh: Any = MeshStatus(*json.loads(zlib.decompress(state)))  # of lists where records belong
    nodes = [NodeStatus(*_with_bytes(values)) for values in mesh.nodes]
    obstacles = [ObstacleStatus(*box) for box in mesh.obstacles]
    fence = [AreaStatus(*area) for area in mesh.fence]
    whole: MeshStatus = replace(mesh, nodes=nodes, obstacles=obstacles, fence=fence)
    return whole


def _plain(value: Any) -> Any:
    """The values of an object in the order of its fields; of bytes their hexadecimal digits."""
    return value.hex() if isinstance(value, bytes) else list(vars(value).values())


def _with_bytes(values: list[Any]) -> list[Any]:
    for at in _OF_BYTES:
        values[at] = bytes.fromhex(values[at])
    return values


class History:
    """States are kept compressed. Belongs to one thread. Times are simulated seconds."""

    def __init__(self, kept_s: float = KEPT_S, kept_bytes: float = KEPT_BYTES) -> None:
        self._kept_s, self._kept_bytes = kept_s, kept_bytes
        self.clear()

    def clear(self) -> None:
        """Forget everything: a new run begins."""
        self._states: list[bytes] = []
        self._bytes = 0
        self._added_at_s = -math.inf  # wall
        self.times: list[float] = []  # one per state, ascending
        self._samples: list[MeshSample] = []  # one per state
        self._events: list[EventRecord] = []  # oldest first
        self._event_times: list[float] = []
        self._events_forgotten = 0
        self.begins_s = -math.inf  # what was before it is forgotten
        self._packets: list[RecordedDots] = []  # oldest first
        self._packet_times: list[float] = []
        self.marks: list[dict[str, Any]] = []  # what a time line shows: t, node and kind

    @classmethod
    def of_run(cls, states: Iterable[MeshStatus], events: Iterable[EventRecord]) -> History:
        """The history of a whole recorded run, oldest first."""
        history = cls(math.inf, math.inf)
        history.extend(states)
        history.add_events(sorted(events, key=lambda event: event.stamp_s))
        return history

    def extend(self, states: Iterable[MeshStatus]) -> None:
        """Add states of a recording, oldest first; of several with the same time only the first."""
        for state in states:
            if not self.times or state.stamp_s > self.times[-1]:
                self._append(state)

    def add(self, mesh: MeshStatus, wall_s: float) -> None:
        """Add a state of a live run unless the last is too recent. A new run clears the history."""
        if self.times and mesh.stamp_s < self.times[-1]:
            self.clear()
        stands_still = bool(self.times) and mesh.stamp_s == self.times[-1]
        if stands_still or wall_s - self._added_at_s < PERIOD_S:
            return
        self._added_at_s = wall_s
        self._append(mesh)
        too_old = bisect.bisect_left(self.times, mesh.stamp_s - self._kept_s)
        size = self._bytes
        while size > self._kept_bytes and too_old < len(self.times) - 1:
            size -= len(self._states[too_old])
            too_old += 1
        if too_old:
            self._forget(too_old)

    def add_events(self, events: Iterable[EventRecord]) -> None:
        """Add events, oldest first."""
        for event in events:
            self._events.append(event)
            self._event_times.append(event.stamp_s)
            if event.kind in _MARKED:
                mark = {"t": event.stamp_s, "kind": _MARKED[event.kind], "node": event.node}
                self.marks = [*self.marks[1 - MOST_MARKS :], mark]

    @property
    def has_packets(self) -> bool:
        """Whether samples of packets were recorded."""
        return bool(self._packets)

    def add_packets(self, samples: Iterable[RecordedDots]) -> None:
        """Keep these of a recording, oldest first."""
        for sample in samples:
            self._packets.append(sample)
            self._packet_times.append(sample.stamp_s)

    def packets_between(self, after_s: float, until_s: float) -> Sequence[RecordedDots]:
        """The samples of packets of this time, oldest first."""
        first, end = (bisect.bisect_right(self._packet_times, t) for t in (after_s, until_s))
        return self._packets[first:end]

    def index_at(self, at_s: float) -> int:
        """Index of the state that shows the mesh at this time."""
        return max(0, bisect.bisect_right(self.times, at_s) - 1)

    def state(self, index: int) -> MeshStatus:
        return unpacked(self._states[index])

    def spread(self, most: int) -> list[bytes]:
        """At most `most` states, evenly over the time, for `unpacked`; the last is included."""
        step = max(1, math.ceil(len(self._states) / most))
        return self._states[::-1][::step][::-1]

    def events_until(self, at_s: float) -> Sequence[EventRecord]:
        """All events up to this time, oldest first."""
        return self._events[: bisect.bisect_right(self._event_times, at_s)]

    def samples_until(self, at_s: float) -> Sequence[MeshSample]:
        """The samples for charts, up to this time."""
        return self._samples[: bisect.bisect_right(self.times, at_s)]

    def states_after(self, at_s: float) -> list[KeptState]:
        first = bisect.bisect_right(self.times, at_s)
        kept = zip(self.times[first:], self._states[first:], self._samples[first:])
        return list(map(KeptState._make, kept))

    def events_after(self, number: int) -> tuple[int, Sequence[EventRecord]]:
        """How many events of this run were added so far, and those after this number of them."""
        forgotten = self._events_forgotten
        return forgotten + len(self._events), self._events[max(0, number - forgotten) :]

    def restore(self, states: Iterable[KeptState]) -> None:
        """Put these before all that is added, oldest first."""
        for state in states:
            self._keep(state)

    def _append(self, mesh: MeshStatus) -> None:
        self._keep(KeptState(mesh.stamp_s, packed(mesh), take_sample(mesh)))

    def _keep(self, state: KeptState) -> None:
        self._states.append(state.packed)
        self._bytes += len(state.packed)
        self.times.append(state.stamp_s)
        self._samples.append(state.sample)

    def _forget(self, states: int) -> None:
        self._bytes -= sum(map(len, self._states[:states]))
        for kept in (self._states, self.times, self._samples):
            del kept[:states]
        self.begins_s = self.times[0]
        old = bisect.bisect_left(self._event_times, self.begins_s)
        self._events_forgotten += old
        del self._events[:old], self._event_times[:old]
        self.marks = [mark for mark in self.marks if mark["t"] >= self.begins_s]
