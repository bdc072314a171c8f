"""Six copters of ArduPilot under gateway and routers, each a program of its own, on one air.

A layout, a mission as motion, a copter that its pilot takes, a relay whose node is killed while its
copter hovers, and its return: nobody comes nearer than 5 m to any other.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping

import pytest
from copter_rig import ORIGIN

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.raspberry.arducopter import SAFE, ArduCopter
from drone_mesh.raspberry.pilot_side import PilotSide

pytestmark = pytest.mark.timeout(1800)  # flights last

RUNS = int(os.environ.get("AUTOPILOT_RUNS", "1"))
PACE = float(os.environ.get("AUTOPILOT_PACE", "1"))  # below 1: slow motion, on a busy machine
PICTURE = os.environ.get("AUTOPILOT_PICTURE")  # file for one of the console
NEAREST_M = 5.0
SOURCE = Path(__file__).resolve().parents[2] / "src"
HEARD_S = 12.0  # two check periods
READY_S = 120.0
FIRST_INSTANCE = 10  # apart from those of other tests
HOMES = {  # on the ground
    1: Location(0.0, 40.0, 0.0),
    2: Location(30.0, 40.0, 0.0),
    3: Location(15.0, 60.0, 0.0),
    4: Location(-40.0, 20.0, 0.0),
    5: Location(0.0, 75.0, 0.0),
    6: Location(-20.0, 60.0, 0.0),
}
LAYOUT = {
    1: Location(0.0, 60.0, 20.0),
    2: Location(30.0, 60.0, 20.0),
    3: Location(10.0, 125.0, 20.0),
    4: Location(-40.0, 20.0, 20.0),
    5: Location(15.0, 190.0, 20.0),
    6: Location(-20.0, 195.0, 20.0),
}
RELAY, TAKEN, ON_MISSION = 3, 2, 4
NODE_OPTIONS = (
    *("--origin", "52.0907,5.1214,3", "--check-period", "5", "--connection-lost-after", "15"),
)


def now_s() -> float:
    """The clock of the copters and of the nodes' programs."""
    return time.monotonic() * PACE


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Fleet:
    """The copters and their pilots, the gateway and the routers."""

    def __init__(self, program: tuple[Path, Path], folder: Path) -> None:
        self._stack = contextlib.ExitStack()
        self._folder = folder
        self._air, self._http = free_port(), free_port()
        self.nearest = (math.inf, "")
        self.places: dict[int, Location] = {}
        self.copters: dict[int, ArduCopter] = {}
        self.pilots: dict[int, PilotSide] = {}
        self.routers: dict[int, subprocess.Popen[bytes]] = {}
        self._log = (folder / "positions.csv").open("w")
        for node, home in HOMES.items():
            own = folder / f"copter{node}"
            own.mkdir()
            # Of the relay no failsafe shall act: its copter has to hover where it is.
            parameters = {**SAFE, "FS_GCS_ENABLE": 0.0 if node == RELAY else 1.0}
            earth = Origin(*ORIGIN.to_earth(home))
            copter = ArduCopter(program, own, FIRST_INSTANCE + node, earth, PACE, parameters)
            self._stack.callback(copter.close)
            self.copters[node] = copter
        for node, copter in self.copters.items():
            self.pilots[node] = PilotSide(copter.pilot_address, copter.system_id)
        for pilot in self.pilots.values():
            pilot.make_ready(READY_S / PACE)
        serving = ("--emulated-air-serve", str(self._air), "--port", str(self._http))
        self._start("gateway", "raspberry.gateway", *serving, *NODE_OPTIONS)
        self.until("the gateway answers", lambda: bool(self.ask("ready")))
        for node in HOMES:
            self.start_router(node)

    def start_router(self, node: int) -> None:
        self.routers[node] = self._start(
            *(f"router{node}", "raspberry.router", "--id", str(node)),
            *("--emulated-air", str(self._air), "--drone", f"mavlink:{self.copters[node].address}"),
            *("--may-arm", "--may-take-off", "--may-change-mode", "--speed", "5"),
            *("--cruise-height", "12", "--layers", "6", *NODE_OPTIONS),
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
        if any(shown.get(node) is None for node in HOMES):
            return math.inf
        return max(self.places[node].distance_m(Location(*shown[node])) for node in HOMES)

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
        row = [f"{now_s():.1f}"]
        for node in sorted(self.places):
            row += [f"{value:.2f}" for value in self.places[node]]
        self._log.write(",".join(row) + "\n")

    def until(self, what: str, holds: Callable[[], bool], within_s: float = 180.0) -> None:
        end_s, due_s = now_s() + within_s, 0.0
        while True:
            if now_s() >= due_s:
                if holds():
                    return
                due_s = now_s() + 1.0
            assert now_s() < end_s, f"{what}; at {self.places}; {self.ask('nodes')}"
            self.watch()

    def watch_for(self, seconds: float) -> None:
        end_s = now_s() + seconds
        while now_s() < end_s:
            self.watch()

    def is_at_rest(self) -> bool:
        """Whether nobody moves within ten seconds, but for the one on a mission."""
        before = dict(self.places)
        self.watch_for(10.0)
        return all(self.is_at(node, before[node], 0.5) for node in HOMES if node != ON_MISSION)

    def is_at(self, node: int, goal: Location, within_m: float = 2.5) -> bool:
        return self.places[node].distance_m(goal) < within_m

    def close(self) -> None:
        for process in self.routers.values():
            process.kill()
        for pilot in self.pilots.values():
            pilot.close()
        self._stack.close()
        self._log.close()

    def photograph(self, path: Path) -> None:
        """The console's page of this mesh, as PNG; needs chromium."""
        from playwright.sync_api import sync_playwright

        port = free_port()
        gateway = f"http://127.0.0.1:{self._http}"
        self._start(
            *("console", "console.gateway_command", "--gateway", gateway, "--port", str(port))
        )
        self.watch_for(5.0)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=["--headless", "--no-sandbox"]
            )
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            page.goto(f"http://127.0.0.1:{port}/")
            self.watch_for(8.0)
            page.screenshot(path=path)
            browser.close()

    def _start(self, name: str, module: str, *options: str) -> subprocess.Popen[bytes]:
        slow = f"import time; real = time.monotonic; time.monotonic = lambda: {PACE} * real()"
        code = f"import sys; {slow}; from drone_mesh.{module} import main; sys.exit(main())"
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


@pytest.fixture
def fleet(program: tuple[Path, Path], tmp_path: Path) -> Iterator[Fleet]:
    fleet = Fleet(program, tmp_path)
    yield fleet
    fleet.close()


@pytest.mark.parametrize("run", range(RUNS))
def test_six_copters_keep_the_mesh_together_and_apart_from_each_other(
    fleet: Fleet, run: int
) -> None:
    started_s = now_s()

    def say(what: str) -> None:
        print(f"{now_s() - started_s:6.1f} s  {what}; nearest {fleet.nearest}", flush=True)

    everybody = set(HOMES)
    fleet.until("all are connected", lambda: fleet.reachable() >= everybody)
    say("all six routers are connected")

    fleet.fly_layout(LAYOUT)
    fleet.until("all are connected", lambda: fleet.reachable() >= everybody)
    say("the layout is flown, everybody is connected")
    fleet.until("the gateway knows the places", lambda: fleet.gateway_error_m() < 3.0)
    say(f"gateway and ground stations agree on all places within {fleet.gateway_error_m():.1f} m")

    if PICTURE:
        fleet.photograph(Path(PICTURE))
    mission = [Location(-40.0, 60.0, 20.0), Location(-60.0, 30.0, 20.0), Location(-40.0, 5.0, 20.0)]
    pilot = fleet.pilots[ON_MISSION]
    pilot.upload([ORIGIN.to_earth(place) for place in mission])
    pilot.choose("AUTO")
    fleet.pilots[TAKEN].choose("BRAKE")  # whose hovering needs no stick
    fleet.until("it stands", fleet.is_at_rest)
    where = fleet.places[TAKEN]
    fleet.order(TAKEN, Location(60.0, 30.0, 20.0))
    words = fleet.outcome(TAKEN)
    say(f"an order for {TAKEN}: {words}")
    assert words.startswith("refused: ")
    assert "in BRAKE, flown by its pilot" in words
    fleet.kill_router(RELAY)
    say(f"copter {ON_MISSION} flies its mission, {TAKEN} is its pilot's, node {RELAY} is killed")

    left = everybody - {RELAY}
    fleet.until("the relay is missed", lambda: not fleet.reachable() >= left, 60.0)
    fleet.until("the group repairs", lambda: fleet.reachable() >= left, 300.0)
    say("the group has repaired the mesh")
    assert fleet.is_at(RELAY, LAYOUT[RELAY], 4.0)  # it hovers on

    fleet.until("everybody has come to rest", fleet.is_at_rest)
    before = dict(fleet.places)
    fleet.start_router(RELAY)
    fleet.until("the relay is back", lambda: fleet.reachable() >= everybody)
    fleet.watch_for(40.0)
    say("the relay's node is back")
    for node in everybody - {ON_MISSION}:
        assert fleet.is_at(node, before[node], 3.0), f"{node} moved: a duel for the place"
    assert fleet.pilots[TAKEN].mode == "BRAKE"
    assert fleet.is_at(TAKEN, where, 5.0)
    assert fleet.pilots[ON_MISSION].mode in ("AUTO", "LOITER")
    assert fleet.nearest[0] >= NEAREST_M
