"""The node /mesh_console: the web console of a running simulation."""

from __future__ import annotations

import logging
import math
import sys
import time
from functools import partial
from pathlib import Path

import rospy

from drone_mesh.console import DEFAULT_PORT
from drone_mesh.console.controls import MeshControls, RecordingControls
from drone_mesh.console.dots import make_dots
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History
from drone_mesh.console.memory import ConsoleMemory, memory_of
from drone_mesh.console.orders import LayoutOffer, places_of
from drone_mesh.console.runner import ConsoleRunner, PageToken
from drone_mesh.console.server import ConsoleServer
from drone_mesh.console.stage import DEMONSTRATIONS
from drone_mesh.console.tiles import open_tiles
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.formations.layouts import FIELD_CASE, GRID_CASE, Layouts
from drone_mesh.msg import MeshEvent, MeshState, PacketSample
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import end_launch, start_node
from drone_mesh.ros.graph.conversions import event_record, mesh_status
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import MasterWatch, master_answers
from drone_mesh.ros.graph.parameters import earth_origin, manager_layouts
from drone_mesh.ros.graph.simulation import Run, run_of
from drone_mesh.ros.views.console_controls import RosControls
from drone_mesh.ros.views.recording import Recording
from drone_mesh.ros.views.state_source import OLD_STATE_S
from drone_mesh.secret_file import read_secret
from drone_mesh.stopping import StopRequest, ends_as
from drone_mesh.web import LOOPBACK
from drone_mesh.web.listening import port_of

CHECK_PERIOD_S = 1.0  # wall time between two checks of the master
WAS_UP = "~was_up"  # in this launch: what ails it now is no bad argument

log = logging.getLogger(__name__)


class MeshFeed:
    """Passes ROS messages to the store and the server, which the runner's loop owns.

    Subscribes: /mesh/state (MeshState), /mesh/events (MeshEvent); while a page draws packets,
                /mesh/packets (PacketSample)

    `_latest` passes from the subscriber's thread to the loop; a loop that lags behind skips states.
    """

    def __init__(
        self,
        store: FrameStore,
        server: ConsoleServer,
        runner: ConsoleRunner,
        memory: ConsoleMemory | None,
    ) -> None:
        """`memory`: None for a recording."""
        self._store = store
        self._server = server
        self._runner = runner
        self._memory = memory
        self._run: Run | None = None  # of the latest state
        self._latest: MeshState | None = None
        self._heard_s = float("-inf")
        self._packets: rospy.Subscriber | None = None
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._on_state, queue_size=1)
        rospy.Subscriber(names.EVENTS_TOPIC, MeshEvent, self._on_event)

    def watch(self, stop: StopRequest) -> None:
        """Say on the pages when nothing is heard, until the program ends; for the main thread."""
        while not stop.wait(CHECK_PERIOD_S) and not rospy.is_shutdown():
            is_silent = time.monotonic() - self._heard_s > OLD_STATE_S
            if not master_answers():
                if is_silent:  # without a master, nodes that are connected still hear each other
                    self._report("no ROS master: waiting for the simulation to start")
                continue
            if is_silent:
                self._report("no data from the simulation")
            self._watch_packets()
            if self._memory is not None:
                self._memory.save()
                self._runner.in_loop(self._memory.collect)

    def _watch_packets(self) -> None:
        """Subscribe while a page draws packets; the simulator samples only with a subscriber."""
        wanted = self._server.packets_wanted
        if wanted and self._packets is None:
            self._packets = rospy.Subscriber(
                names.PACKETS_TOPIC, PacketSample, self._on_packets, queue_size=1
            )
        elif not wanted and self._packets is not None:
            self._packets.unregister()
            self._packets = None

    def _report(self, text: str) -> None:
        self._runner.in_loop(partial(self._store.set_link, text))

    def _on_state(self, message: MeshState) -> None:
        self._heard_s = time.monotonic()
        is_waiting, self._latest = self._latest is not None, message
        if not is_waiting:
            self._runner.in_loop(self._take_latest)

    def _take_latest(self) -> None:
        message, self._latest = self._latest, None
        if message is not None:
            before, self._run = self._run, run_of(message)
            if self._memory is not None and before != self._run:
                self._memory.recall(self._run)
            self._store.update_mesh(mesh_status(message), time.monotonic())

    def _on_event(self, message: MeshEvent) -> None:
        self._runner.in_loop(partial(self._store.add_events, [event_record(message)]))

    def _on_packets(self, message: PacketSample) -> None:
        dots = make_dots(message.senders, message.receivers, message.types, message.ages)
        self._runner.in_loop(partial(self._server.show_packets, message.carried, dots))


def layout_offers(layouts: Layouts) -> list[LayoutOffer]:
    """All layouts: first those of several drones, then those of one."""
    known = {FIELD_CASE: "field case", GRID_CASE: "10 x 10 grid"}
    offers = []
    for case in layouts.cases:
        places = places_of(layouts.orders(case))
        drones = len(places)
        what = known.get(case, f"{drones} drones") if drones > 1 else f"drone {case} of case 0"
        offers.append((drones == 1, LayoutOffer(case, f"{case}: {what}", places)))
    return [offer for _single, offer in sorted(offers)]


def main() -> None:
    """Runs the web console, which shows and controls the mesh in a browser.

    Parameters (private): ~address (str, 127.0.0.1) and ~port (int, 8080) to listen on; ~token_file
    (str): path of a file with the password of the console, which only its owner can access;
    without it, a random one is made and printed if other machines can reach the address; ~demo
    (str): "repair" or "relief" shows one as soon as a page is open; ~recording (str): path of the
    bag that is played; its page takes no orders; ~origin (str): LAT,LON,ALT, where the world's
    origin is on the earth, in degrees and metres above sea level, by default that of the running
    simulation; ~tiles (str): a map, see open_tiles.
    /DroneManager/casus (str): the file of the layouts; /drone_mesh/origin (str).
    """
    start_node(main.__doc__, "mesh_console")
    status = ends_as("console")(_run)()
    if status == 1 and not rospy.has_param(WAS_UP):
        end_launch()
    sys.exit(status)


def _run() -> int:
    show_library_logs_on_rosout()
    address = str(rospy.get_param("~address", LOOPBACK))
    port = port_of(rospy.get_param("~port", DEFAULT_PORT))
    token = _token(address)
    demo = str(rospy.get_param("~demo", ""))
    if demo and demo not in DEMONSTRATIONS:
        known = ", ".join(DEMONSTRATIONS)
        raise ConfigurationError(f"invalid demo {demo!r}: must be {known} or empty")
    recording = str(rospy.get_param("~recording", ""))
    origin = earth_origin(str(rospy.get_param("~origin", "")), is_live=not recording)
    whole = History(math.inf, math.inf) if recording else None
    chosen = str(rospy.get_param("~tiles", ""))
    if chosen and origin is None:
        raise ConfigurationError("tiles:= needs origin:=LAT,LON,ALT: where the world is on the map")
    with naming_argument("tiles:=", chosen.partition("#")[0]):
        tiles = open_tiles(chosen) if chosen else None
    store = FrameStore(History() if whole is None else None, origin)
    layouts = layout_offers(manager_layouts())
    access = token.access(address)
    controls: MeshControls = RecordingControls() if recording else RosControls()
    server = ConsoleServer(
        store,
        controls,
        access,
        layouts,
        demo,
        recording=Path(recording).name,
        whole=whole,
        tiles=tiles,
    )
    runner = ConsoleRunner(server, address, port)
    stop = StopRequest()  # created where signals are handled, in the thread that waits
    rospy.on_shutdown(stop.make)
    runner.start()
    if demo:
        print("the demonstration begins when a browser opens this page:", flush=True)
    rospy.set_param(WAS_UP, True)
    print(token.greeting(address, runner.port), flush=True)
    reading = None if whole is None else Recording(Path(recording), whole, runner)
    try:
        if reading is not None:
            reading.start()
        MasterWatch().start()
        memory = ConsoleMemory(store, memory_of(address, port)) if whole is None else None
        MeshFeed(store, server, runner, memory).watch(stop)
    finally:
        if reading is not None:
            reading.stop()
        runner.stop()
    return 0


def _token(address: str) -> PageToken:
    if rospy.has_param("~token"):
        raise ConfigurationError(
            "~token: everybody on the ROS network can read parameters, and every user of this "
            "machine arguments; delete it (rosparam delete), put a new token into a file "
            "(chmod 600) and give token_file"
        )
    path = str(rospy.get_param("~token_file", ""))
    with naming_argument("token_file:=", path):
        token = read_secret(Path(path), "token") if path else ""
    return PageToken.needed(address, token, path)
