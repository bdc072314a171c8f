"""Player: the position of one page in a history; it plays, pauses, steps and jumps."""

from __future__ import annotations

import time
from dataclasses import replace

from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History
from drone_mesh.drone.geodesy import Origin

_AHEAD = 60.0  # a longer jump, in simulated seconds, shows no single events


class Player:
    """Fills its own store with states of the history. Belongs to the server's event loop."""

    def __init__(self, history: History, at_s: float, origin: Origin | None = None) -> None:
        """`history` must have at least one state."""
        self._history = history
        self.store = FrameStore(origin=origin)
        self.paused, self.factor = False, 1.0
        self.now_s = at_s
        self._shown_s: float | None = None
        self.show(at_s)

    @property
    def at_end(self) -> bool:
        """Whether it has shown the newest state."""
        return self.now_s >= self._history.times[-1]

    def advance(self, wall_s: float) -> None:
        """Advance by `wall_s` wall seconds."""
        if not self.paused:
            self.show(self.now_s + wall_s * self.factor)

    def step(self, states: int) -> None:
        """Move by this many states, back if negative, and pause."""
        times = self._history.times
        index = min(max(self._history.index_at(self.now_s) + states, 0), len(times) - 1)
        self.pause(True)
        self.show(times[index])

    def pause(self, paused: bool) -> None:
        """Pause or resume."""
        self.paused, self._shown_s = paused, None  # the page must be informed
        self.show(self.now_s)

    def show(self, at_s: float) -> None:
        """Show the mesh as it was at this time."""
        times = self._history.times
        self.now_s = min(max(at_s, times[0]), times[-1])
        index = self._history.index_at(self.now_s)
        shown_s, stamp_s = self._shown_s, times[index]
        if stamp_s == shown_s:
            return
        self._shown_s = stamp_s
        seen = self._history.events_until(stamp_s)
        if shown_s is None or not shown_s < stamp_s < shown_s + _AHEAD:
            self.store.restart(self._history.samples_until(stamp_s)[:-1])
        else:
            seen = seen[len(self._history.events_until(shown_s)) :]
        state = self._history.state(index)
        self.store.update_mesh(
            replace(
                state,
                real_time_factor=self.factor,
                achieved_real_time_factor=self.factor,
                paused=self.paused,
            ),
            time.monotonic(),
        )
        self.store.add_events(seen)
