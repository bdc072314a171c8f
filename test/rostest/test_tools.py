"""status, snapshot and report: live, from a bag that record.launch made, and without a master."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import tempfile
import unittest
from collections import Counter
from pathlib import Path
from typing import Callable, Iterator

import genpy.dynamic
import rosbag
import rospy
from rostest_support import (
    WALL_LIMIT_S,
    call,
    preload,
    receives,
    run_program,
    wait_for,
)

from drone_mesh.msg import HostReport, MeshEvent, MeshState, NodeState
from drone_mesh.ros.views.bag import RecordedMesh
from drone_mesh.srv import PowerSwitch, SetSpeed

TOOLS = ("status", "snapshot", "report")
PLOTTING = ("drone_mesh.ros.views.report", "matplotlib.pyplot")
ROS_NODES = {
    "drone_factory": "world.drone_factory_node",
    "drone_manager": "services.drone_manager",
    "wireless_signal_simulator": "services.wireless_signal_simulator",
    "mesh_host": "host.mesh_host_node",
    "fly_actions": "services.fly_actions",
    "ground_station": "services.ground_station",
    "mesh_markers": "views.markers_node",
    "console": "views.console_node",
}
OLD_DETAIL = "order 7 to x 1.00 m, y 2.00 m, z 3 m: battery at 9 %"


def gateway_record() -> Iterator[str]:
    """Five seconds, as raspberry_gateway --record writes them; node 3 is lost after three."""
    number = 0
    for second in range(1, 6):
        connected = second <= 3
        events = []
        if second in (1, 4):
            number += 1
            kind = "connected" if connected else "disconnected"
            event = {"number": number, "t": second, "node": 3, "kind": kind, "peers": [0]}
            events = [{**event, "detail": ""}]
        both = {"on": True, "heard_s_ago": 0.0, "reported": True, "flying": False, "earth": None}
        gateway = {"id": 0, "role": "gateway", "connected": True, "hops": 0, "next_hop": 0}
        router = {"id": 3, "role": "router", "connected": connected, "hops": None, "next_hop": None}
        nodes = [
            {**both, **gateway, "place": [0.0, 0.0, 0.0], "why_not_fly": ""},
            {**both, **router, "place": [9.0, 40.0, float(second)], "why_not_fly": ""},
        ]
        yield json.dumps({"gateway": 0, "uptime_s": second, "nodes": nodes, "events": events})


def record_in_an_older_definition(path: Path) -> None:
    """A bag with one state and one event, of messages without their newer fields."""
    newer = (
        r"(float32 (airtime|tries|battery)|uint16 queue|uint32 given_up|bool crashed|string \w+"
        r"|(Obstacle|FenceArea)\[\] \w+) .*\n"
    )
    definition = re.sub(newer, "", MeshState._full_text)
    older = genpy.dynamic.generate_dynamic("drone_mesh/MeshState", definition)
    node = older["drone_mesh/NodeState"](id=4, connected=True, on=True, position=[1.0, 2.0, 0.0])
    definition = re.sub(r"(uint16 order|Location\[\] place) .*\n", "", MeshEvent._full_text)
    older.update(genpy.dynamic.generate_dynamic("drone_mesh/MeshEvent", definition))
    event = older["drone_mesh/MeshEvent"](kind="order sent", node=0, peers=[4], detail=OLD_DETAIL)
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/mesh/state", older["drone_mesh/MeshState"](nodes=[node]))
        bag.write("/mesh/events", event)


def recorder_listens() -> bool:
    """Whether state and events go to the recorder; it looks for topics once a second."""
    topics = ("/mesh/state", "/mesh/events")
    return all(receives("/mesh_recorder", topic, "/DroneFactory") for topic in topics)


def connected(*node_ids: int) -> Callable[[MeshState], bool]:
    return lambda state: set(node_ids) <= {node.id for node in state.nodes if node.connected}


def lost(node_id: int) -> Callable[[MeshState], bool]:
    """Whether it knows: not only the answer to one heartbeat is late."""
    return lambda state: any(
        node.id == node_id and node.repair_state != NodeState.AT_REST for node in state.nodes
    )


class ToolsTest(unittest.TestCase):
    """The first stops the time: the others need no mesh, and cost less without it."""

    @classmethod
    def setUpClass(cls) -> None:
        preload(*PLOTTING, *(f"drone_mesh.ros.{module}" for module in ROS_NODES.values()))

    def setUp(self) -> None:
        self.state: MeshState | None = None
        self.came: Counter[str] = Counter()
        rospy.Subscriber("/mesh/state", MeshState, self._on_state)
        rospy.Subscriber("/mesh/reports", HostReport, self._on_report)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def _on_state(self, message: MeshState) -> None:
        self.state = message
        self.came["/mesh/state"] += 1

    def _on_report(self, _message: HostReport) -> None:
        self.came["/mesh/reports"] += 1

    def pause_when(self, what: str, *conditions: Callable[[MeshState], bool]) -> None:
        """Stop the time at a moment at which all this holds.

        Stopped, because on a busy machine the answer to a heartbeat may come too late at any time.
        """
        while True:
            wait_for(what, 2 * WALL_LIMIT_S, lambda: self.holds(*conditions))
            call("/DroneFactory/setSpeed", SetSpeed, True, 0.0)
            # The first message may be from before; the second report is in the second state.
            for topic in ("/mesh/reports", "/mesh/state"):
                self.wait_for_two(topic)
            if self.holds(*conditions):
                return
            self.go_on()

    def wait_for_two(self, topic: str) -> None:
        enough = self.came[topic] + 2
        wait_for(f"messages on {topic}", WALL_LIMIT_S, lambda: self.came[topic] >= enough)

    def holds(self, *conditions: Callable[[MeshState], bool]) -> bool:
        state = self.state
        return state is not None and all(condition(state) for condition in conditions)

    def go_on(self, factor: float = 0.0) -> None:
        call("/DroneFactory/setSpeed", SetSpeed, False, factor)

    def test_2_each_tool_explains_itself(self) -> None:
        for tool in TOOLS:
            finished = run_program(tool, "--help")
            self.assertEqual(finished.returncode, 0, finished.stderr)
            self.assertIn(f"usage: rosrun drone_mesh {tool}", finished.stdout)
            self.assertIn("Exit code", finished.stdout)

    def test_2_each_node_explains_itself_and_leaves_the_one_that_runs_alone(self) -> None:
        for node in ROS_NODES:
            finished = run_program(node, "--help")
            self.assertEqual(finished.returncode, 0, finished.stderr)
            self.assertIn(f"usage: rosrun drone_mesh {node}", finished.stdout)
            refused = run_program(node, "--nonsense")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("unrecognized arguments: --nonsense", refused.stderr)

    def test_2_without_a_master_no_node_waits_for_one(self) -> None:
        for node in ROS_NODES:
            finished = run_program(node, ROS_MASTER_URI="http://127.0.0.1:9")
            self.assertEqual(finished.returncode, 2)
            self.assertIn(f"{node}: no ROS master at http://127.0.0.1:9", finished.stderr)
            self.assertNotIn("Traceback", finished.stderr)

    def test_2_without_a_master_there_is_one_line_that_says_so(self) -> None:
        for arguments in (["status"], ["status", "--watch"], ["snapshot", "picture.png"]):
            finished = run_program(*arguments, ROS_MASTER_URI="http://127.0.0.1:9")
            self.assertEqual(finished.returncode, 2)
            self.assertIn("no ROS master at http://127.0.0.1:9", finished.stderr)
            self.assertNotIn("Traceback", finished.stderr)

    def test_2_without_a_screen_there_is_one_line_that_says_so(self) -> None:
        finished = run_program("rviz_window", DISPLAY="")
        self.assertEqual(finished.returncode, 2)
        line = "rviz_window: rviz: no screen (DISPLAY is not set); use rviz:=false"
        self.assertIn(line, finished.stderr)
        self.assertNotIn("Traceback", finished.stderr)

    def test_2_a_recording_of_an_older_definition_is_read(self) -> None:
        bag = self.folder / "older.bag"
        record_in_an_older_definition(bag)
        finished = run_program("status", "--bag", str(bag))
        self.assertEqual(finished.stderr, "")
        heading, _columns, row = finished.stdout.splitlines()
        self.assertNotIn("routing", heading)
        self.assertRegex(row, r"^4 .* 1\.0, 2\.0, 0\.0 ")
        (event,) = RecordedMesh(bag).events()
        self.assertEqual((event.order, event.place, event.explanation()), (0, None, OLD_DETAIL))
        report = run_program("report", str(bag), "-o", f"{self.folder}/older.html")
        self.assertEqual(report.returncode, 0, report.stderr)

    def test_2_the_record_of_a_gateway_is_read_in_the_place_of_a_bag(self) -> None:
        record = self.folder / "flight.jsonl"
        record.write_text("".join(f"{line}\n" for line in gateway_record()))
        status = run_program("status", "--bag", str(record))
        self.assertIn("0 of 1 routers connected", status.stdout, status.stderr)
        report = run_program("report", str(record), "--csv", str(self.folder))
        self.assertEqual(report.returncode, 0, report.stderr)
        self.assertIn("disconnected", (self.folder / "events.csv").read_text(encoding="utf-8"))
        trace = run_program("flight_trace", str(record), f"{self.folder}/flown.csv")
        self.assertIn("2 drones, 4.0 s", trace.stdout, trace.stderr)
        tracks = self.folder / "flown.geojson"
        refused = run_program("flight_trace", str(record), str(tracks))
        self.assertIn("needs --origin", refused.stderr)
        lines = [{**json.loads(line), "origin": [52.0, 5.0, 3.0]} for line in gateway_record()]
        known = self.folder / "known.jsonl"
        known.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
        for given in ([str(known)], [str(record), "--origin", "52,5,3"]):
            written = run_program("flight_trace", *given[:1], str(tracks), *given[1:])
            self.assertEqual(written.returncode, 0, written.stderr)
            (track,) = json.loads(tracks.read_text(encoding="utf-8"))["features"]
            self.assertEqual(track["properties"]["drone"], 3)
            self.assertEqual(track["properties"]["times_s"], [0.0, 1.0, 2.0, 3.0, 4.0])
            longitude, latitude, height = track["geometry"]["coordinates"][0]
            self.assertAlmostEqual(longitude, 5.0005824, delta=1e-6)
            self.assertAlmostEqual(latitude, 52.0000809, delta=1e-6)
            self.assertAlmostEqual(height, 4.0, delta=0.01)
        bag = RecordedMesh(record).playable()
        self.assertEqual(bag, self.folder / "flight.jsonl.bag")
        self.assertEqual(RecordedMesh(bag).topics(), ("/", {"/mesh/state", "/mesh/events"}))
        self.assertEqual(
            [mesh.stamp_s for mesh in RecordedMesh(bag).states()], [1.0, 2.0, 3.0, 4.0, 5.0]
        )

    def test_1_a_run_is_seen_live_and_recorded_and_told(self) -> None:
        recorder = subprocess.Popen(
            ["roslaunch", "drone_mesh", "record.launch", f"bag:={self.folder}/run"],
            stdout=subprocess.DEVNULL,
        )
        try:
            wait_for("a bag", WALL_LIMIT_S, lambda: list(self.folder.glob("*.bag.active")))
            wait_for("the recorder listens", WALL_LIMIT_S, recorder_listens)
            self.pause_when("all connected", connected(0, 1, 2, 3))
            finished = run_program("status")
            self.assertEqual(finished.returncode, 0, finished.stdout + finished.stderr)
            self.assertIn("3 of 3 routers connected", finished.stdout)
            self.assertNotIn("\x1b", finished.stdout)
            self.assertEqual(run_program("snapshot", f"{self.folder}/live.png").returncode, 0)
            call("/Nodes/2/powerSwitch", PowerSwitch, False)
            # At full speed the repair could mend it before the world is paused.
            self.go_on(1.0)
            self.pause_when("3 is lost", connected(0, 1), lost(3))
            self.assertEqual(run_program("status").returncode, 1)
            self.go_on(8.0)
            self.pause_when("the repair", connected(0, 1, 3))
            self.assertEqual(run_program("status").returncode, 0)
        finally:
            recorder.send_signal(signal.SIGINT)
            recorder.wait(timeout=WALL_LIMIT_S)
        (bag,) = self.folder.glob("*.bag")
        self._look_into(bag)

    def _look_into(self, bag: Path) -> None:
        finished = run_program("status", "--bag", str(bag))
        self.assertEqual(finished.returncode, 0, finished.stderr)
        self.assertIn("2 of 2 routers connected, 1 switched off", finished.stdout)
        early = run_program("status", "--bag", str(bag), "--at", "0")
        self.assertEqual(early.returncode, 2)
        self.assertRegex(early.stderr, r"no state up to 0 s; the recording starts at \d+\.\d s")
        late = run_program("status", "--bag", str(bag), "--at", "100000")
        self.assertEqual(late.returncode, 2)
        self.assertRegex(late.stderr, r"no state at 100000 s; the recording ends at \d+\.\d s")
        self.assertEqual(
            run_program("snapshot", "--bag", str(bag), f"{self.folder}/bag.png").returncode, 0
        )
        small = f"{self.folder}/small.png"
        sized = run_program("snapshot", "--bag", str(bag), "--size", "320x200", small)
        self.assertEqual(sized.returncode, 0, sized.stderr)
        size = Path(small).read_bytes()[16:24]  # of the PNG's header
        self.assertEqual(size, bytes.fromhex("00000140 000000c8"))
        for when, coloured in (("always", True), ("never", False)):
            table = run_program("status", "--bag", str(bag), "--colour", when).stdout
            self.assertEqual("\x1b[" in table, coloured)
        trace = run_program("flight_trace", str(bag), f"{self.folder}/flight.csv")
        self.assertEqual(trace.returncode, 0, trace.stderr)
        self.assertEqual(Path(f"{self.folder}/flight.csv").read_text()[:11], "t,id,x,y,z\n")
        picture = run_program("snapshot", "--bag", str(bag), f"{self.folder}/bag.xyz")
        self.assertEqual(picture.returncode, 2)
        self.assertIn("must end in .png", picture.stderr)
        self.assertFalse((self.folder / "bag.xyz").exists())
        for picture in ("live.png", "bag.png"):
            self.assertEqual((self.folder / picture).read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        finished = run_program(
            *("report", str(bag), "-o", f"{self.folder}/run.html", "--csv", str(self.folder)),
            *("--title", "A field day"),
        )
        self.assertEqual(finished.returncode, 0, finished.stderr)
        page = (self.folder / "run.html").read_text(encoding="utf-8")
        self.assertIn("<h1>A field day</h1>", page)
        events = (self.folder / "events.csv").read_text(encoding="utf-8")
        self.assertTrue("<td>2 off</td>" in page, f"the page lacks the cause of the loss: {events}")
        self.assertIn("flight decided", events)

    def test_2_what_is_no_bag_is_refused_in_one_line(self) -> None:
        nonsense = self.folder / "nonsense.bag"
        nonsense.write_bytes(b"\x89 this is not a bag")
        for path in (nonsense, self.folder / "missing.bag"):
            for arguments, given in ((["status", "--bag"], "--bag "), (["report"], "report: ")):
                finished = run_program(*arguments, str(path))
                self.assertEqual(finished.returncode, 2)
                self.assertRegex(
                    finished.stderr, f"{given}{path}: no(t a complete bag| such file);"
                )
                self.assertIn("'roslaunch drone_mesh record.launch' records one", finished.stderr)
                self.assertNotIn("Traceback", finished.stderr)
