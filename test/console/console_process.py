"""A console over an in-process mesh, in a process of its own: python console_process.py --help."""

from __future__ import annotations

import argparse
import asyncio
import logging
import threading
import time

from inprocess_mesh import InProcessMesh

from drone_mesh.console.access import access_for
from drone_mesh.console.frames import FrameStore
from drone_mesh.console.runner import LOOK_PERIOD_S, run_console
from drone_mesh.console.server import ConsoleServer

LAYOUTS = [(0, "0: field case, 17 drones"), (100, "100: grid 10 x 10"), (999, "999: none such")]


async def feed(mesh: InProcessMesh, store: FrameStore) -> None:
    while True:
        status, events = mesh.look()
        store.update_mesh(status, time.monotonic())
        if events:
            store.add_events(events)
        await asyncio.sleep(LOOK_PERIOD_S)


async def serve(options: argparse.Namespace, mesh: InProcessMesh) -> None:
    store = FrameStore()
    server = ConsoleServer(store, mesh, access_for(options.address, options.token), LAYOUTS)
    feeding = asyncio.ensure_future(feed(mesh, store))
    try:
        await run_console(server, options.address, options.port)
    finally:
        feeding.cancel()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8181)
    parser.add_argument("--address", default="127.0.0.1")
    parser.add_argument("--token", default="")
    parser.add_argument("--routers", type=int, default=17)
    parser.add_argument("--gridsize", type=int, default=6)
    parser.add_argument("--spacing", type=float, default=6.0)
    parser.add_argument("--skip", type=float, default=5.0, help="simulated seconds before it opens")
    options = parser.parse_args()
    logging.basicConfig(level=logging.INFO)
    mesh = InProcessMesh(options.routers, options.gridsize, options.spacing)
    mesh.skip(options.skip)
    stop = threading.Event()
    running = threading.Thread(target=mesh.run, args=(stop,), daemon=True)
    running.start()
    try:
        asyncio.run(serve(options, mesh))
    finally:
        stop.set()
        running.join()


if __name__ == "__main__":
    main()
