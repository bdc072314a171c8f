"""Copters of ArduPilot, gateway and routers: programs of their own, on one emulated air."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import shutil
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Iterator, Mapping, Sequence

from arducopter import SAFE, ArduCopter
from copter_rig import ORIGIN, WORKER
from patience import free_port
from pilot_side import PilotSide

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location

if TYPE_CHECKING:
    from playwright.sync_api import Page

SOURCE = Path(__file__).resolve().parents[2] / "src"
HEARD_S = 12.0  # two check periods
READY_S = 120.0
FIRST_INSTANCE = 20 + 10 * WORKER  # apart from those of other tests
NODE_OPTIONS = (
    *("--origin", "52.0907,5.1214,3", "--check-period", "5", "--connection-lost-after", "15"),
)
FLIGHT_OPTIONS = (
    *("--may-arm", "--may-take-off", "--may-change-mode"),
    *("--cruise-height", "12", "--layers", "6"),
)


class Fleet:
    """The copters and their pilots, the gateway and the routers."""

    def __init__(
        self,
        program: tuple[Path, Path],
        folder: Path,
        homes: Mapping[int, Location],
        pace: float,
        speed_m_s: float = 5.0,
        hovers_on: int | None = None,
        flight_options: Sequence[str] = (),
    ) -> None:
        """Copters on the ground at `homes`; `hovers_on`: of this one no failsafe acts.

        `pace`: how fast the clocks of the copters and of all programs go; 1: as the wall's.
        """
        self._homes = homes
        self._pace = pace
        self._flight_options = (*FLIGHT_OPTIONS, "--speed", f"{speed_m_s:g}", *flight_options)
        self._stack = contextlib.ExitStack()
        self._folder = folder
        self._air, self._http = free_port(), free_port()
        self.nearest = (math.inf, "")
        self.places: dict[int, Location] = {}
        self.copters: dict[int, ArduCopter] = {}
        self.pilots: dict[int, PilotSide] = {}
        self.routers: dict[int, subprocess.Popen[bytes]] = {}
        self.gateway: subprocess.Popen[bytes] | None = None
        self._log = (folder / "positions.csv").open("w")
        for node, home in homes.items():
            own = folder / f"copter{node}"
            own.mkdir()
            parameters = {**SAFE, "FS_GCS_ENABLE": 0.0 if node == hovers_on else 1.0}
            earth = Origin(*ORIGIN.to_earth(home))
            copter = ArduCopter(program, own, FIRST_INSTANCE + node, earth, pace, parameters)
            self._stack.callback(copter.close)
            self.copters[node] = copter
        for node, copter in self.copters.items():
            self.pilots[node] = PilotSide(copter.pilot_address, copter.system_id)
        for pilot in self.pilots.values():
            pilot.make_ready(READY_S / pace)
        far_away = ("--id", "250", "--latitude", "4000", "--longitude", "4000")
        serving = ("--emulated-air-serve", str(self._air), "--port", str(free_port()))
        self._start("air", "raspberry.program:gateway", *serving, *far_away, *NODE_OPTIONS)
        self.start_gateway()
        for node in homes:
            self.start_router(node)

    def __enter__(self) -> Fleet:
        return self

    def __exit__(self, *_error: object) -> None:
        for process in self.routers.values():
            process.kill()
        for pilot in self.pilots.values():
            pilot.close()
        self._stack.close()
        self._log.close()

    def now_s(self) -> float:
        """The clock of the copters and of the nodes' programs."""
        return time.monotonic() * self._pace

    def start_gateway(self) -> None:
        """The air is that of another program, so it may end and start again."""
        joining = ("--emulated-air", str(self._air), "--port", str(self._http))

        def answers() -> bool:
            if self.gateway is None or self.gateway.poll() is not None:  # the air was not there yet
                program = "raspberry.program:gateway"
                self.gateway = self._start("gateway", program, *joining, *NODE_OPTIONS)
            return bool(self.ask("ready"))

        self.until("the gateway answers", answers)

    def kill_gateway(self) -> None:
        assert self.gateway is not None
        self.gateway.kill()
        self.gateway.wait()

    def start_router(self, node: int) -> None:
        self.routers[node] = self._start(
            *(f"router{node}", "raspberry.program:router", "--id", str(node)),
            *("--emulated-air", str(self._air), "--drone", f"mavlink:{self.copters[node].address}"),
            *(*self._flight_options, *NODE_OPTIONS),
        )

    def kill_router(self, node: int) -> None:
        self.routers[node].kill()
        self.routers[node].wait()

    def ask(self, path: str, data: bytes | None = None) -> Any:
        request = urllib.request.Request(
            f"http://127.0.0.1:{self._http}/{path}", data, method="GET" if data is None else "POST"
        )
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                return json.loads(answer.read() or b"true")
        except (OSError, ValueError):
            return None

    def order(self, node: int, goal: Location) -> None:
        path = f"DroneMovement/{node}/{goal.latitude:g}/{goal.longitude:g}/{goal.height:g}"
        self.until(f"order for {node} is sent", lambda: self.ask(path, b"") is not None)

    def fly_layout(self, layout: Mapping[int, Location]) -> None:
        """Order it, and again what was given up, as its operator would; each time is printed."""
        for node, goal in layout.items():
            self.order(node, goal)

        def is_flown() -> bool:
            latest = {o["drone"]: o for o in (self.ask("orders") or {"orders": []})["orders"]}
            for node, order in latest.items():
                if order["state"] in ("given up", "refused", "no route"):
                    print(f"{node} again: {order['state']}, {order['reason']}", flush=True)
                    self.order(node, layout[node])
            return all(self.is_at(node, goal) for node, goal in layout.items())

        self.until("the layout is flown", is_flown, 300.0)

    def outcome(self, node: int) -> str:
        """What the gateway says in the end about the latest order of this drone."""
        latest: dict[str, Any] = {}

        def is_over() -> bool:
            orders = (self.ask("orders") or {"orders": []})["orders"]
            latest.update([o for o in orders if o["drone"] == node][-1:][0])
            return latest["state"] in ("refused", "given up", "arrived", "no route")

        self.until(f"the order for {node} is over", is_over)
        return f"{latest['state']}: {latest['reason']}"

    def reachable(self) -> set[int]:
        """The nodes that the gateway heard within two check periods."""
        nodes = (self.ask("nodes") or {"nodes": []})["nodes"]
        heard = [n for n in nodes if n["next_hop"] is not None and n["heard_s_ago"] is not None]
        return {n["id"] for n in heard if n["heard_s_ago"] < HEARD_S}

    def gateway_error_m(self) -> float:
        """How far the places that the gateway shows are from those of the ground stations."""
        shown = {n["id"]: n["place"] for n in (self.ask("mesh?after=0") or {"nodes": []})["nodes"]}
        if any(shown.get(node) is None for node in self._homes):
            return math.inf
        return max(self.places[node].distance_m(Location(*shown[node])) for node in self._homes)

    def watch(self) -> None:
        """Read all positions once; keep the smallest distance."""
        for node, pilot in self.pilots.items():
            pilot.read(0.01)
            if pilot.place is not None:
                self.places[node] = ORIGIN.to_frame(pilot.place)
        for one, other in itertools.combinations(sorted(self.places), 2):
            distance_m = self.places[one].distance_m(self.places[other])
            if distance_m < self.nearest[0]:
                where = f"{self.places[one].in_words()} and {self.places[other].in_words()}"
                self.nearest = (distance_m, f"{one} and {other}, {where}")
        row = [f"{self.now_s():.1f}"]
        for node in sorted(self.places):
            row += [f"{value:.2f}" for value in self.places[node]]
        self._log.write(",".join(row) + "\n")

    def until(self, what: str, holds: Callable[[], bool], within_s: float = 180.0) -> None:
        end_s, due_s = self.now_s() + within_s, 0.0
        while True:
            if self.now_s() >= due_s:
                if holds():
                    return
                due_s = self.now_s() + 1.0
            assert self.now_s() < end_s, f"{what}; at {self.places}; {self.ask('nodes')}"
            self.watch()

    def watch_for(self, seconds: float) -> None:
        end_s = self.now_s() + seconds
        while self.now_s() < end_s:
            self.watch()

    def is_at_rest(self, but: int) -> bool:
        """Whether nobody else moves within ten seconds."""
        before = dict(self.places)
        self.watch_for(10.0)
        return all(self.is_at(node, before[node], 0.5) for node in self._homes if node != but)

    def is_at(self, node: int, goal: Location, within_m: float = 2.5) -> bool:
        return self.places[node].distance_m(goal) < within_m

    @contextlib.contextmanager
    def page(self) -> Iterator[Page]:
        """The console's page of this mesh in a browser; needs chromium, as test/console does."""
        from playwright.sync_api import sync_playwright

        port = free_port()
        gateway = f"http://127.0.0.1:{self._http}"
        options = ("--gateway", gateway, "--port", str(port))
        console = self._start("console", "console.gateway_command:main", *options)
        self.watch_for(5.0 * self._pace)
        with sync_playwright() as playwright:
            installed = shutil.which("chromium-headless-shell") or shutil.which("chromium")
            browser = playwright.chromium.launch(
                executable_path=os.environ.get("CHROMIUM") or installed,
                args=["--headless", "--no-sandbox"],
            )
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            page.set_default_timeout(120e3)  # ms: the machine may be busy
            page.goto(f"http://127.0.0.1:{port}/")
            yield page
            browser.close()
        console.kill()

    def _start(self, name: str, program: str, *options: str) -> subprocess.Popen[bytes]:
        module, _, main = program.partition(":")
        slow = f"import time; real = time.monotonic; time.monotonic = lambda: {self._pace} * real()"
        code = f"import sys; {slow}; from drone_mesh.{module} import {main}; sys.exit({main}())"
        with (self._folder / f"{name}.log").open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-c", code, *options],
                env={**os.environ, "PYTHONPATH": str(SOURCE)},
                stdout=log,
                stderr=log,
            )
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process
