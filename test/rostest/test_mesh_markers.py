"""The frames and markers for rviz, and rviz itself with our configuration."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import unittest

import rosgraph
import rospkg
import rospy
from rostest_support import WALL_LIMIT_S, call, wait_for
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from drone_mesh.msg import Location, MeshState
from drone_mesh.srv import PowerSwitch, SetSpeed

RVIZ_LIMIT_S = 40.0  # software rendering is slow


class MeshMarkersTest(unittest.TestCase):
    def setUp(self) -> None:
        self.markers: dict[tuple[str, int], Marker] = {}
        self.frames: dict[str, tuple[float, float, float]] = {}
        self.stamps: list[tuple[str, rospy.Time]] = []  # of frames, in the order they came
        self.states = 0
        self.paused = False
        self.subscribers = [
            rospy.Subscriber("/mesh/state", MeshState, self._on_state),
            rospy.Subscriber("/mesh/markers", MarkerArray, self._on_markers),
            rospy.Subscriber("/tf", TFMessage, self._on_frames),
        ]

    def tearDown(self) -> None:
        for subscriber in self.subscribers:
            subscriber.unregister()

    def _on_state(self, state: MeshState) -> None:
        self.paused = state.paused
        self.states += 1

    def _on_markers(self, array: MarkerArray) -> None:
        markers = dict(self.markers)
        for marker in array.markers:
            if marker.action == Marker.DELETE:
                markers.pop((marker.ns, marker.id), None)
            else:
                markers[marker.ns, marker.id] = marker
        self.markers = markers  # the test looks at whole arrays only

    def _on_frames(self, message: TFMessage) -> None:
        for transform in message.transforms:
            place = transform.transform.translation
            self.stamps.append((transform.child_frame_id, transform.header.stamp))
            self.frames[transform.child_frame_id] = (place.x, place.y, place.z)
            self.assertEqual(transform.header.frame_id, "map")

    def points(self, name: str) -> int:
        marker = self.markers.get((name, 0))
        return 0 if marker is None else len(marker.points)

    def meshes(self, name: str) -> list[str]:
        """The files of the markers with this name, in the order of their ids."""
        shown = sorted((key, marker) for key, marker in self.markers.items() if key[0] == name)
        return [marker.mesh_resource.rpartition("/")[2] for _, marker in shown]

    def names(self) -> list[str]:
        return sorted(m.text for (name, _), m in self.markers.items() if name == "ids")

    def router_2_is_grey(self) -> bool:
        shares = [getattr(self.markers["lamps", 2].color, c) for c in "rgb"]
        return max(shares) - min(shares) < 0.1

    def test_1_each_drone_has_a_frame_a_mesh_a_name_and_the_links_that_are_there(self) -> None:
        wait_for("frames", WALL_LIMIT_S, lambda: len(self.frames) == 3)
        self.assertEqual(self.frames["drone_2"], (6.0, 0.0, 0.0))
        wait_for(
            "a standing frame and a lamp for each",
            WALL_LIMIT_S,
            lambda: (
                (self.meshes("frames"), self.meshes("lamps"))
                == (["standing.obj"] * 3, ["gateway_lamp.obj"] + ["router_lamp.obj"] * 2)
            ),
        )
        legend = [m.text for (name, _), m in self.markers.items() if name == "legend"]
        self.assertIn("disconnected", legend)
        wait_for("names", WALL_LIMIT_S, lambda: self.names() == ["0", "1", "2"])
        # 0 and 1 are 1 m apart, 0 and 2 are 7 m, 1 and 2 are 6 m: three links, two of them routes.
        wait_for("routes", WALL_LIMIT_S, lambda: self.points("links: route") == 4)
        self.assertEqual(self.points("fence: stay in"), 2 * 4 * 2)  # an outline, and no height
        # Three corners at two heights, and a post at each; of a circle, posts at some.
        self.assertEqual(self.points("fence: stay out"), 2 * (3 * 3 + 64 * 2 + 16))
        heights = {point.z for point in self.markers["fence: stay out", 0].points}
        self.assertEqual(sorted(heights), [2.05, 20.05])
        fence = [m.text for (name, _), m in self.markers.items() if name == "fence names"]
        self.assertEqual(fence, ["yard", "tower", "mast"])
        # What starts later, or changes it, does not read the file again, which may be another now.
        areas = json.loads(rospy.get_param("/drone_mesh/fence"))["areas"]
        self.assertEqual([area["name"] for area in areas], fence)
        wait_for("a known link", WALL_LIMIT_S, lambda: self.points("links: known") == 2)

    def test_2_a_node_that_is_off_is_grey_and_its_links_are_lost(self) -> None:
        wait_for("routes", WALL_LIMIT_S, lambda: self.points("links: route") == 4)
        call("/Nodes/2/powerSwitch", PowerSwitch, False)
        wait_for("lost links", WALL_LIMIT_S, lambda: self.points("links: lost") == 4)
        wait_for("one route link left", WALL_LIMIT_S, lambda: self.points("links: route") == 2)
        wait_for("2 is grey", WALL_LIMIT_S, self.router_2_is_grey)
        call("/Nodes/2/powerSwitch", PowerSwitch, True)
        wait_for("no lost links", WALL_LIMIT_S, lambda: self.points("links: lost") == 0)

    def test_3_the_rotors_of_a_drone_turn_while_it_flies(self) -> None:
        goals = rospy.Publisher("/Drones/2/goal", Location, queue_size=1, latch=True)
        turned: set[float] = set()

        def rotors_turn() -> bool:
            marker = self.markers.get(("rotors", 0))
            if marker is not None:
                self.assertEqual(len(marker.points), 4 * 2)  # of one drone
                turned.add(round(marker.points[0].x - marker.points[1].x, 3))
            return len(turned) > 2

        goals.publish(latitude=0.0, longitude=6.0, height=20)
        wait_for("turning rotors", WALL_LIMIT_S, rotors_turn)
        wait_for("rotors at rest", WALL_LIMIT_S, lambda: ("rotors", 0) not in self.markers)
        goals.publish(latitude=0.0, longitude=6.0, height=0)
        wait_for("2 lands", WALL_LIMIT_S, lambda: self.frames["drone_2"] == (6.0, 0.0, 0.0))
        goals.unregister()

    def test_4_a_paused_mesh_sends_no_frame_twice_and_shows_itself_to_newcomers(self) -> None:
        wait_for("frames", WALL_LIMIT_S, lambda: len(self.frames) == 3)
        call("/DroneFactory/setSpeed", SetSpeed, True, 0.0)
        try:
            wait_for("a paused state", WALL_LIMIT_S, lambda: self.paused)
            self.stamps.clear()
            seen = self.states
            wait_for("twenty states", WALL_LIMIT_S, lambda: self.states >= seen + 20)
            self.assertEqual(len(self.stamps), len(set(self.stamps)), self.stamps)
            newcomer = ["rostopic", "echo", "-n", "1", "/tf/transforms[0]/child_frame_id"]
            shown = subprocess.run(
                newcomer, stdout=subprocess.PIPE, timeout=WALL_LIMIT_S, check=True, text=True
            )
            self.assertIn("drone_0", shown.stdout)
        finally:
            call("/DroneFactory/setSpeed", SetSpeed, False, 2.0)

    @unittest.skipUnless(shutil.which("rviz") and shutil.which("Xvfb"), "rviz or Xvfb is missing")
    def test_5_rviz_runs_with_the_shipped_configuration_and_looks_at_the_mesh(self) -> None:
        config = os.path.join(rospkg.RosPack().get_path("drone_mesh"), "config", "drone_mesh.rviz")
        read, write = os.pipe()
        options = ["-screen", "0", "1000x700x24", "-nolisten", "tcp", "-noreset"]
        screen = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), *options],
            pass_fds=[write],
        )
        os.close(write)
        rviz = None
        try:
            with os.fdopen(read) as numbers:  # one line, once the server listens
                display = f":{numbers.readline().strip()}"
            environment = {**os.environ, "DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"}
            rviz = subprocess.Popen(["rviz", "-d", config, "__name:=test_rviz"], env=environment)
            wait_for("rviz to subscribe", RVIZ_LIMIT_S, self._rviz_looks)
            self.assertIsNone(rviz.poll(), "rviz ended")
        finally:
            for process in (rviz, screen):
                if process is not None:
                    process.terminate()
                    process.wait(timeout=WALL_LIMIT_S)

    def _rviz_looks(self) -> bool:
        _publishers, subscribers, _services = rosgraph.Master("/test").getSystemState()
        return "/test_rviz" in dict(subscribers).get("/mesh/markers", [])
