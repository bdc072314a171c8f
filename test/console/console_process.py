"""A console over an in-process mesh, in a process of its own: python console_process.py --help."""

from __future__ import annotations

import argparse
import logging
import signal
import threading
import time

from inprocess_mesh import InProcessMesh

from drone_mesh.console.dots import RecordedDots
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.gateway_client import GatewayControls
from drone_mesh.console.history import History
from drone_mesh.console.orders import LayoutOffer, places_of
from drone_mesh.console.runner import ConsoleRunner
from drone_mesh.console.server import ALL_ACTIONS, FRAME_PERIOD_S, ConsoleServer
from drone_mesh.console.tiles import open_tiles
from drone_mesh.drone.geodesy import Origin
from drone_mesh.fence_file import rows_of_file
from drone_mesh.formations.layouts import Layouts
from drone_mesh.web.access import access_for

LAYOUTS = [
    LayoutOffer(0, "0: field case, 17 drones", places_of(Layouts({}).orders(0))),
    LayoutOffer(100, "100: grid 10 x 10", places_of(Layouts({}).orders(100))),
    LayoutOffer(998, "998: far", [(1, 0.0, 60.0, 0.0), (2, 0.0, 7.0, 0.0), (200, 0.0, 9.0, 0.0)]),
    LayoutOffer(999, "999: none such", []),
]


def feed(mesh: InProcessMesh, store: FrameStore, relief: bool) -> None:
    status, events = mesh.read()
    if relief:
        for node in status.nodes[1:]:
            node.battery, node.time_left, node.home = 87.0, 803.0, tuple(node.position)
        low, new, served = status.nodes[1:4]
        low.battery, low.time_left, new.relieves = 24.0, 48.0, low.id
        served.pad = "the crew swaps its battery: 12 s left"
    store.update_mesh(status, time.monotonic())
    if events:
        store.add_events(events)


def recorded(options: argparse.Namespace) -> History:
    """All of a run of the same mesh; node 5 goes off in its middle."""
    mesh = InProcessMesh(options.routers, options.gridsize, options.spacing)
    states, events, packets = [], [], []
    steps = int(options.recorded * 2)
    for step in range(steps):
        if step == steps // 2:
            mesh.power(5, False)
        mesh.skip(0.5)
        state, happened = mesh.read()
        states.append(state)
        events += happened
        packets.append(RecordedDots.pack(state.stamp_s, *mesh.packets(0.5)))
    history = History.of_run(states, events)
    history.add_packets(packets)
    return history


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8181)
    parser.add_argument("--address", default="127.0.0.1")
    parser.add_argument("--token", default="")
    parser.add_argument("--routers", type=int, default=17)
    parser.add_argument("--gridsize", type=int, default=6)
    parser.add_argument("--spacing", type=float, default=6.0)
    parser.add_argument("--skip", type=float, default=5.0, help="simulated seconds before it opens")
    parser.add_argument(
        "--haste",
        type=float,
        default=0.0,
        help="times faster than ordered, and time passes only from frame to frame: none is missed",
    )
    parser.add_argument("--demonstrate", action="store_true")
    parser.add_argument("--recording", default="")
    parser.add_argument(
        "--recorded", type=float, default=0.0, help="simulated seconds of a recording; 2 a second"
    )
    parser.add_argument("--origin", default="", metavar="LAT,LON,ALT")
    parser.add_argument("--fence", default="", metavar="FILE")
    parser.add_argument("--relief", action="store_true", help="2 relieves 1, 3 gets a battery")
    parser.add_argument("--tiles", default="", metavar="MAP")
    parser.add_argument("--real", action="store_true", help="offer what a real gateway can do")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO)
    mesh = InProcessMesh(options.routers, options.gridsize, options.spacing)
    whole = recorded(options) if options.recorded else None
    mesh.skip(options.skip)
    origin = Origin.parse(options.origin) if options.origin else None
    if options.fence:
        mesh.keep_to(rows_of_file(options.fence, origin))
    store = FrameStore(History() if whole is None else None, origin)
    access = access_for(options.address, options.token)
    server = ConsoleServer(
        store,
        mesh,
        access,
        LAYOUTS,
        "repair" if options.demonstrate else "",
        GatewayControls.ACTIONS if options.real else ALL_ACTIONS,
        recording=options.recording,
        whole=whole,
        tiles=open_tiles(options.tiles) if options.tiles else None,
    )
    runner = ConsoleRunner(server, options.address, options.port)
    stop = threading.Event()
    # A flag and not the event: the handler may run while this thread holds the event's lock.
    asked_to_stop = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked_to_stop.append(True))
    running = threading.Thread(target=mesh.run, args=(stop,))
    if not options.haste:
        running.start()
    runner.start()
    print(f"serving on port {runner.port}", flush=True)
    is_fed = threading.Event()
    is_fed.set()

    def feed_once() -> None:
        if options.haste and not mesh.paused:
            mesh.skip(FRAME_PERIOD_S * mesh.factor * options.haste)
        feed(mesh, store, options.relief)
        server.show_packets(*mesh.packets(FRAME_PERIOD_S))
        is_fed.set()

    while not asked_to_stop:
        time.sleep(FRAME_PERIOD_S)
        if is_fed.is_set():  # on a machine that is too slow, feed less often
            is_fed.clear()
            runner.in_loop(feed_once)
    stop.set()
    runner.stop()
    if not options.haste:
        running.join()


if __name__ == "__main__":
    main()
