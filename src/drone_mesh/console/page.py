"""Page: one open page, which shows the present or, with a Player, a moment of the history."""

from __future__ import annotations

import asyncio
import json
import time
from dataclasses import replace
from typing import Any, Iterator, Sequence

from starlette.websockets import WebSocket

from drone_mesh.console.dots import Dot, PacketDots
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History
from drone_mesh.console.orders import TimeLine
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
        if not self.paused:
            self.show(self.now_s + wall_s * self.factor)

    def step(self, states: int) -> None:
        """Move by this many states, back if negative, and pause."""
        times = self._history.times
        index = min(max(self._history.index_at(self.now_s) + states, 0), len(times) - 1)
        self.pause(True)
        self.show(times[index])

    def pause(self, paused: bool) -> None:
        """Pause, at the time of the state that is shown, or resume.

        A link names that time with two digits: a time between two states, rounded, could be of the
        next one.
        """
        self.paused, self._shown_s = paused, None  # the page must be informed
        times = self._history.times
        self.show(times[self._history.index_at(self.now_s)] if paused else self.now_s)

    def show(self, at_s: float) -> None:
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


class Page:
    """Belongs to the server's event loop."""

    def __init__(
        self, socket: WebSocket, live: FrameStore, history: History, is_live: bool
    ) -> None:
        """`is_live`: there is a present to return to; otherwise the page shows only the history."""
        self.socket = socket
        self.watching: int | None = None  # the node whose neighbours it shows
        self.packets = PacketDots()
        self.waiting: set[asyncio.Task[None]] = set()  # orders and questions without an answer yet
        self._live, self._history, self._is_live = live, history, is_live
        self._player = None if is_live else Player(history, history.times[0], live.origin)
        self._version = 0  # of what the page has
        self._time_line: dict[str, Any] = {}
        self._marks: list[dict[str, Any]] = []
        self._told: list[str] = []  # what other pages ordered

    def tell(self, text: str) -> None:
        """Show what another page has ordered."""
        self._told.append(text)

    @property
    def store(self) -> FrameStore:
        """The store that the page shows."""
        return self._live if self._player is None else self._player.store

    def messages(self, wall_s: float) -> Iterator[str]:
        """Messages with what is new for the page; `wall_s` wall seconds have passed."""
        if self._player is not None:
            self._play(self._player, wall_s)
        store = self.store
        if self._version != store.version:
            # Only what is sent counts as known, so a page that falls behind gets everything at
            # once.
            frame, self._version = store.frame_since(self._version), store.version
            yield frame
            if self.watching is not None:
                yield self.detail(self.watching)
        while self._told:
            yield json.dumps({"type": "told", "text": f"another window: {self._told.pop(0)}"})
        yield from self.packets.messages()
        if self._history.times:
            yield from self._time_line_messages()

    def show_packets(self, carried: int, dots: Sequence[Dot]) -> None:
        """`carried` packets arrived in the present; `dots` are a sample of them."""
        if self._player is None:
            self.packets.add(carried, dots)

    def move(self, request: TimeLine) -> None:
        """Move to another moment."""
        if request.live and self._is_live:
            self._look_at(None)
            return
        if not self._history.times:
            return
        if self._player is None:
            self._look_at(Player(self._history, self._present_s(), self._live.origin))
        player = self._player
        assert player is not None
        if request.factor is not None:
            player.factor = request.factor
        if request.t is not None:
            player.show(request.t)
        if request.paused is not None:
            player.pause(request.paused)
        if request.step:
            player.step(request.step)

    def detail(self, node: int) -> str:
        """The neighbours of a node, as JSON text."""
        return json.dumps({"type": "detail", "node": node, **self.store.detail_of(node)})

    def _play(self, player: Player, wall_s: float) -> None:
        if not self._history.times or self._history.times[-1] < player.now_s:
            self._look_at(None)  # another run has begun
            return
        before_s = player.now_s
        player.advance(wall_s)
        for sample in self._history.packets_between(before_s, player.now_s):
            age_s = (player.now_s - sample.stamp_s) / player.factor
            self.packets.add(sample.carried, sample.dots(age_s))
        if self._is_live and player.at_end and not player.paused:
            mesh = self._live.mesh
            if mesh is not None and mesh.stamp_s >= player.now_s:
                self._look_at(None)

    def _present_s(self) -> float:
        """Simulated seconds; for a recording being played, its current position."""
        mesh = self._live.mesh
        return self._history.times[0] if mesh is None else mesh.stamp_s

    def _look_at(self, player: Player | None) -> None:
        self._player, self._version = player, 0
        self.packets.clear()

    def _time_line_messages(self) -> Iterator[str]:
        times, player = self._history.times, self._player
        now_s = self._present_s() if player is None else player.now_s
        time_line = {
            "type": "timeline",
            "start": times[0],
            "end": times[-1],
            "now": min(max(now_s, times[0]), times[-1]),
            "live": player is None,
            "paused": player is not None and player.paused,
            "factor": 1.0 if player is None else player.factor,
            "packets": self._history.has_packets,
        }
        if time_line != self._time_line:
            self._time_line = time_line
            yield json.dumps(time_line)
        if self._history.marks is not self._marks:
            self._marks = self._history.marks
            yield json.dumps({"type": "marks", "marks": self._marks})
