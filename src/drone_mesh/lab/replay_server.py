"""The web console on a recorded run, with a time line: drag to any moment, play, pause, step."""

from __future__ import annotations

import bisect
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Sequence

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response
from starlette.routing import Mount, Route

from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.console.frames import FrameStore
from drone_mesh.console.orders import OrderRefused
from drone_mesh.console.runner import ConsoleRunner
from drone_mesh.console.server import STATIC as CONSOLE_STATIC
from drone_mesh.console.server import ConsoleServer, Guard
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.web.access import Access

STATIC = Path(__file__).resolve().parent / "static"
LOOPBACK = "127.0.0.1"
TICK_S = 0.1  # of the wall
MARKED = {
    MeshEventKind.POWER_OFF.value: "off",
    MeshEventKind.POWER_ON.value: "on",
    MeshEventKind.DISCONNECTED.value: "lost",
    MeshEventKind.FLIGHT_DECIDED.value: "flight",
}
_HEAD = '<link rel="stylesheet" href="/timeline.css"><script type="module" src="/timeline.js">'


class Player:
    """Where in the run the page is. Belongs to the server's event loop."""

    def __init__(
        self, states: Sequence[MeshStatus], events: Sequence[EventRecord], store: FrameStore
    ) -> None:
        """`states` oldest first, at least one."""
        self._states, self._store = states, store
        self._events = sorted(events, key=lambda event: event.stamp_s)
        self._times = [state.stamp_s for state in states]
        self._event_times = [event.stamp_s for event in self._events]
        self._shown = -1  # index of the state that the page has
        self._told = 0  # events that it has
        self.paused, self.factor = False, 1.0
        self.now_s = self._times[0]
        self.show(self.now_s)

    def advance(self, wall_s: float) -> None:
        """So much wall time has passed."""
        if not self.paused:
            self.show(self.now_s + wall_s * self.factor)

    def step(self, states: int) -> None:
        """So many states on, or back; and pause."""
        self.paused = True
        place = min(max(self._shown + states, 0), len(self._times) - 1)
        self._shown = -1  # also where the place stays: the page has to learn of the pause
        self.show(self._times[place])

    def show(self, at_s: float) -> None:
        """Show the mesh as it was at this time."""
        self.now_s = min(max(at_s, self._times[0]), self._times[-1])
        place = max(0, bisect.bisect_right(self._times, self.now_s) - 1)
        told = bisect.bisect_right(self._event_times, self.now_s)
        if place == self._shown:
            return
        self._shown = place
        state = self._states[place]
        went_back = told < self._told
        wall_s = time.monotonic()
        self._store.update_mesh(
            replace(
                state,
                real_time_factor=self.factor,
                achieved_real_time_factor=self.factor,
                paused=self.paused,
            ),
            wall_s,
        )
        self._store.add_events(self._events[0 if went_back else self._told : told])
        self._told = told

    def describe(self) -> dict[str, object]:
        """For the time line."""
        marks = [
            {"t": event.stamp_s, "kind": MARKED[event.kind], "node": event.node}
            for event in self._events
            if event.kind in MARKED
        ]
        return {
            "start": self._times[0], "end": self._times[-1], "now": self.now_s,
            "paused": self.paused, "marks": marks,
        }  # fmt: skip


class _Controls:
    """What the console's own buttons do here: only time can be changed."""

    def __init__(self, player: Player) -> None:
        self._player = player

    def power(self, node: int, on: bool) -> str:
        raise OrderRefused("this is a recorded run")

    def fly(self, node: int, x: float, y: float, z: float) -> str:
        raise OrderRefused("this is a recorded run")

    def layout(self, case: int) -> str:
        raise OrderRefused("this is a recorded run")

    def speed(self, paused: bool, factor: float) -> str:
        self._player.paused = paused
        self._player.factor = factor or 100.0  # 0 is "as fast as possible"
        self._player.step(0) if paused else None
        return "paused" if paused else f"{self._player.factor:g} x"


class ReplayServer(ConsoleServer):
    """The console's server with a time line in its page."""

    def __init__(self, player: Player, store: FrameStore, title: str) -> None:
        access = Access()  # loopback only
        super().__init__(store, _Controls(player), access)
        self._player, self._title = player, title
        self.app = Starlette(
            routes=[
                Route("/", self._page),
                Route("/timeline.js", self._file),
                Route("/timeline.css", self._file),
                Route("/timeline", self._timeline, methods=["GET", "POST"]),
                Mount("/", self.app),
            ],
            middleware=[Middleware(Guard, access=access)],
        )

    async def _page(self, _request: Request) -> Response:
        page = (CONSOLE_STATIC / "index.html").read_text(encoding="utf-8")
        return HTMLResponse(page.replace("</head>", f"{_HEAD}</script></head>", 1))

    async def _file(self, request: Request) -> Response:
        return FileResponse(STATIC / request.url.path.lstrip("/"))

    async def _timeline(self, request: Request) -> Response:
        player = self._player
        if request.method == "POST":
            try:
                wanted = json.loads(await request.body())
                if "t" in wanted:
                    player.show(float(wanted["t"]))
                if "step" in wanted:
                    player.step(int(wanted["step"]))
                if "paused" in wanted:
                    player.paused = bool(wanted["paused"])
                    player.step(0) if player.paused else None
            except (ValueError, TypeError, KeyError) as error:
                return JSONResponse({"error": str(error)}, 400)
        return JSONResponse({**player.describe(), "title": self._title})


def serve_replay(
    states: Sequence[MeshStatus], events: Sequence[EventRecord], title: str, port: int
) -> None:
    """Serve until Ctrl-C. Raises ConfigurationError if the port is not available."""
    store = FrameStore()
    player = Player(states, events, store)
    runner = ConsoleRunner(ReplayServer(player, store, title), LOOPBACK, port)
    runner.start()
    print(f"{title}: {runner.url}  (Ctrl-C ends it)", flush=True)
    try:
        while True:
            time.sleep(TICK_S)
            runner.in_loop(lambda: player.advance(TICK_S))
    except KeyboardInterrupt:
        pass
    finally:
        runner.stop()
