"""The program drone_mesh_console: the web console of a real mesh. Needs no ROS."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import time
from functools import partial
from typing import Mapping, Sequence

from drone_mesh.arguments import whole
from drone_mesh.console import DEFAULT_PORT
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.gateway_client import (
    GatewayClient,
    GatewayControls,
    events_of,
    origin_of,
    real_mesh,
)
from drone_mesh.console.history import History
from drone_mesh.console.memory import ConsoleMemory, memory_of
from drone_mesh.console.runner import ConsoleRunner, PageToken
from drone_mesh.console.server import ConsoleServer
from drone_mesh.console.tiles import open_tiles
from drone_mesh.errors import ConfigurationError
from drone_mesh.stopping import StopRequest, ends_as
from drone_mesh.web import LOOPBACK
from drone_mesh.web.json_client import NoAnswer
from drone_mesh.web.listening import MAX_PORT

ASK_PERIOD_S = 1.0
GATEWAY_TOKEN = "DRONE_MESH_TOKEN"  # as of the gateway
PAGE_TOKEN = "DRONE_MESH_CONSOLE_TOKEN"


class GatewayFeed:
    """Polls the gateway once a second and passes its answers to the store. One thread."""

    def __init__(
        self, client: GatewayClient, store: FrameStore, runner: ConsoleRunner, memory: ConsoleMemory
    ) -> None:
        self._client = client
        self._store = store
        self._runner = runner
        self._memory = memory
        self._seen = 0  # number of the last event
        self._run: str | None = None  # of the gateway, from its start to its end
        self._uptime_s = 0.0

    def ask(self) -> None:
        """Poll once. If the gateway does not answer, the page shows that."""
        try:
            answer = self._client.mesh(self._seen)
            mesh, more = real_mesh(answer)
            origin = origin_of(answer)
            run = str(answer.get("run", ""))  # an older gateway does not tell
            is_new = run != self._run or mesh.stamp_s < self._uptime_s
            seen = self._memory.seen_in(run) if is_new else self._seen
            told = answer["events"] if not (is_new and self._seen) else ()  # of another run
            told = [event for event in told if int(event["number"]) > seen]
            events = events_of({"events": told})
            seen = max((int(event["number"]) for event in told), default=seen)
        except NoAnswer as error:
            self._runner.in_loop(partial(self._store.set_link, str(error)))
            return
        except (ConfigurationError, KeyError, TypeError, ValueError) as error:
            text = f"{self._client.url}: invalid answer: {error!r}"
            self._runner.in_loop(partial(self._store.set_link, text))
            return
        self._seen, self._run, self._uptime_s = seen, run, mesh.stamp_s

        def show() -> None:
            if is_new:
                self._memory.recall(run)
            self._store.origin = origin
            self._store.update_mesh(mesh, time.monotonic(), more)
            if events:
                self._store.add_events(events)
            self._memory.seen = seen
            self._memory.collect()

        self._runner.in_loop(show)
        self._memory.save()


@ends_as("drone_mesh_console")
def main(
    arguments: Sequence[str] | None = None, environment: Mapping[str, str] = os.environ
) -> int:
    """Run until Ctrl-C or SIGTERM; the exit status."""
    options = _parsed(arguments)
    logging.basicConfig(format="%(levelname)s %(message)s", level="INFO")
    token = PageToken.needed(options.bind, environment.get(PAGE_TOKEN, ""), f"${PAGE_TOKEN}")
    with StopRequest() as stop:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: stop.make())
        client = GatewayClient(options.gateway, environment.get(GATEWAY_TOKEN, ""))
        tiles = open_tiles(options.tiles) if options.tiles else None
        store, controls = FrameStore(History()), GatewayControls(client)
        access = token.access(options.bind)
        server = ConsoleServer(store, controls, access, actions=controls.ACTIONS, tiles=tiles)
        runner = ConsoleRunner(server, options.bind, options.port)
        memory = ConsoleMemory(store, memory_of(options.bind, options.port))
        runner.start()
        print(token.greeting(options.bind, runner.port), flush=True)
        feed = GatewayFeed(client, store, runner, memory)
        try:
            feed.ask()
            while not stop.wait(ASK_PERIOD_S):
                feed.ask()
        finally:
            runner.stop()
    return 0


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        "drone_mesh_console",
        description="Serves the web console of a real mesh: it shows the state that the gateway "
        "reports, and sends orders to drones through the gateway.",
        epilog=f"Environment: {GATEWAY_TOKEN}, the token of the gateway, if it needs one; "
        f"{PAGE_TOKEN}, the token of the page (default with --bind: a random one, which is "
        "printed).",
    )
    parser.add_argument(
        "--gateway",
        required=True,
        metavar="URL",
        help="address of the gateway, as in http://pi:9080",
    )
    parser.add_argument(
        "--bind",
        default=LOOPBACK,
        metavar="ADDRESS",
        help="address to listen on (default: %(default)s)",
    )
    parser.add_argument(
        "--port",
        type=whole(0, MAX_PORT),
        default=DEFAULT_PORT,
        help="TCP port (default: %(default)s; 0: any free one)",
    )
    parser.add_argument(
        "--tiles",
        default="",
        metavar="MAP",
        help="a map under the drones, if the nodes have an --origin: an MBTiles file, "
        "or an address with {z}, {x} and {y} (default: none)",
    )
    options = parser.parse_args(arguments)
    if not options.gateway.startswith(("http://", "https://")):
        parser.error(f"--gateway {options.gateway}: must begin with http:// or https://")
    return options
