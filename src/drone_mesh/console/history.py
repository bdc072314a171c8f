"""History: recorded states and events of a run; for a live run, the last 30 minutes."""

from __future__ import annotations

import bisect
import math
import pickle
import zlib
from typing import Any, Iterable, Sequence

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.console.dots import RecordedDots
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.state.outages import MeshSample, take_sample

KEPT_S = 1800.0  # simulated
KEPT_BYTES = 64_000_000  # 254 nodes with 200 neighbours each need some 20 kB per state
PERIOD_S = 0.4  # wall, between two states of a live run
MOST_MARKS = 400
_MARKED = {
    MeshEventKind.POWER_OFF.value: "off",
    MeshEventKind.POWER_ON.value: "on",
    MeshEventKind.DISCONNECTED.value: "lost",
    MeshEventKind.FLIGHT_DECIDED.value: "flight",
}


def unpacked(state: bytes) -> MeshStatus:
    """The state in a compressed form that a History keeps. Any thread."""
    mesh: MeshStatus = pickle.loads(zlib.decompress(state))
    return mesh


class History:
    """States are kept compressed. Belongs to one thread. Times are simulated seconds."""

    def __init__(self, kept_s: float = KEPT_S, kept_bytes: float = KEPT_BYTES) -> None:
        self._kept_s, self._kept_bytes = kept_s, kept_bytes
        self._clear()

    def _clear(self) -> None:
        self._states: list[bytes] = []
        self._bytes = 0
        self._added_at_s = -math.inf  # wall
        self.times: list[float] = []  # one per state, ascending
        self._samples: list[MeshSample] = []  # one per state
        self._events: list[EventRecord] = []  # oldest first
        self._event_times: list[float] = []
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
            self._clear()
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
        """The state at this index."""
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

    def _append(self, mesh: MeshStatus) -> None:
        packed = zlib.compress(pickle.dumps(mesh), 1)
        self._states.append(packed)
        self._bytes += len(packed)
        self.times.append(mesh.stamp_s)
        self._samples.append(take_sample(mesh))

    def _forget(self, states: int) -> None:
        """Drop the oldest `states` states."""
        self._bytes -= sum(map(len, self._states[:states]))
        for kept in (self._states, self.times, self._samples):
            del kept[:states]
        old = bisect.bisect_left(self._event_times, self.times[0])
        del self._events[:old], self._event_times[:old]
        self.marks = [mark for mark in self.marks if mark["t"] >= self.times[0]]
