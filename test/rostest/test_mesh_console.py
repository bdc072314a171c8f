"""The console's orders reach the real system, and its page shows the real state."""

from __future__ import annotations

import json
import os
import re
import signal
import sqlite3
import subprocess
import tempfile
import threading
import unittest
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import psutil
import rosgraph
import rospy
import websockets.exceptions
import websockets.sync.client
from rostest_support import (
    WALL_LIMIT_S,
    LogWatch,
    kill_and_wait_for_respawn,
    pid_of,
    program,
    run_program,
    wait_for,
)

from drone_mesh.console.memory import memory_of, read_memory
from drone_mesh.state.alarms import AlarmBook
from drone_mesh.web import LOOPBACK

HOST = "127.0.0.1:18181"
MEMORY = memory_of(LOOPBACK, 18181)
TOKEN = "a-token-for-this-test"
CONSOLE = ("__name:=guarded_console", "_port:=0")


class Page:
    """What a browser's page does: it applies frames and sends orders."""

    def __init__(self) -> None:
        self.nodes: dict[str, dict] = {}
        self.clock: dict = {}
        self.layouts: list = []
        self.packets: list[dict] = []
        self.answers: dict[int, dict] = {}
        self.events: list[dict] = []
        self.alarms: list[dict] = []
        self.samples: list[dict] = []
        self._socket = websockets.sync.client.connect(
            f"ws://{HOST}/ws", origin=f"http://{HOST}", proxy=None, max_size=None
        )
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        try:
            for text in self._socket:
                self._apply(json.loads(text))
        except websockets.exceptions.ConnectionClosed:
            pass

    def _apply(self, message: dict) -> None:
        if message["type"] == "hello":
            self.layouts = message["layouts"]
        elif message["type"] == "packets":
            self.packets.append(message)
        elif message["type"] == "answer":
            self.answers[message["number"]] = message
        elif message["type"] == "frame":
            self.clock = message["clock"]
            if message["full"]:
                self.events, self.samples = [], []
            self.events += message.get("events", [])
            self.samples += message.get("samples", [])
            self.alarms = message.get("alarms", self.alarms)
            for node, fields in message.get("nodes", {}).items():
                # As a whole: the test reads it in another thread.
                self.nodes[node] = {**self.nodes.get(node, {}), **fields}

    def all_connected(self) -> bool:
        return all(n["condition"] == "connected" for n in list(self.nodes.values()))

    def ask(self, **request: object) -> None:
        self._socket.send(json.dumps(request))

    def order(self, **request: object) -> dict:
        number = len(self.answers) + 1
        self._socket.send(json.dumps({**request, "number": number}))
        wait_for(f"an answer to {request}", WALL_LIMIT_S, lambda: number in self.answers)
        return self.answers[number]


def open_page() -> Page:
    pages: list[Page] = []

    def tried() -> bool:
        try:
            pages.append(Page())
        except (OSError, websockets.exceptions.InvalidHandshake):
            return False
        return True

    wait_for("the console to answer", WALL_LIMIT_S, tried)
    page = pages[0]
    wait_for(
        "three nodes that report on the page",
        WALL_LIMIT_S,
        lambda: [n["condition"] != "silent" for n in list(page.nodes.values())] == [True] * 3,
    )
    return page


class MeshConsoleTest(unittest.TestCase):
    def setUp(self) -> None:
        for service in ("/DroneManager/SetToCasus", "/DroneManager/requestDroneMovement"):
            rospy.wait_for_service(service, timeout=WALL_LIMIT_S)

    def test_1_orders_are_carried_out(self) -> None:
        log = LogWatch()
        page = open_page()
        wait_for("two connected routers", WALL_LIMIT_S, page.all_connected)
        self.assertIn([202, "202: 5 drones"], [layout[:2] for layout in page.layouts])
        self.assertTrue(page.order(do="power", node=1, on=False)["done"])
        wait_for("1 is off", WALL_LIMIT_S, lambda: not page.nodes["1"]["on"])
        self.assertTrue(page.order(do="power", node=1, on=True)["done"])
        wait_for("all connected again", WALL_LIMIT_S, page.all_connected)
        self.assertTrue(page.order(do="fly", node=2, x=5.0, y=4.0, z=0)["done"])
        wait_for("2 arrived", WALL_LIMIT_S, lambda: page.nodes["2"]["position"] == [5.0, 4.0, 0.0])
        self.assertTrue(page.order(do="speed", paused=True, factor=0)["done"])
        wait_for("paused", WALL_LIMIT_S, lambda: page.clock["paused"])
        self.assertTrue(page.order(do="speed", paused=False, factor=3)["done"])
        wait_for("faster", WALL_LIMIT_S, lambda: page.clock["factor"] == 3)
        found = page.order(do="preview", case=1)
        self.assertTrue(found["done"], found["text"])
        self.assertEqual(found["preview"]["out_of_reach"], [1])
        two = page.order(do="formation", name="two", places=[[1, 3, 5, 0], [2, 6, 5, 0]])
        self.assertTrue(two["done"], two["text"])
        places = [[3.0, 5.0, 0.0], [6.0, 5.0, 0.0]]
        wait_for(
            "both at their places",
            WALL_LIMIT_S,
            lambda: [page.nodes[n]["position"] for n in ("1", "2")] == places,
        )
        again = page.order(do="formation", name="two", places=[[1, 3, 5, 0], [2, 6, 5, 0]])
        self.assertTrue(again["done"], again["text"])
        self.assertEqual(
            again["text"], "two: ordered 0 of 2 drones; drones 1..2 are at their places"
        )
        wait_for("all connected after it", WALL_LIMIT_S, page.all_connected)
        self.assertTrue(page.order(do="layout", case=1)["done"])
        wait_for("1 flies", WALL_LIMIT_S, lambda: page.nodes["1"]["path"])
        self.assertEqual(log.failures(), [])

    def test_1_the_origin_is_that_of_the_running_simulation(self) -> None:
        open_page()
        with urlopen(f"http://{HOST}/earth/places.geojson", timeout=5) as answer:
            places = json.load(answer)["features"]
        self.assertEqual([place["properties"]["drone"] for place in places], [1, 2])
        self.assertAlmostEqual(places[0]["geometry"]["coordinates"][1], 52.09, delta=0.01)

    def test_7_a_layout_whose_drones_have_no_route_yet_is_kept_and_carried_out_later(self) -> None:
        page = open_page()
        wait_for("two connected routers", WALL_LIMIT_S, page.all_connected)
        for node in (1, 2):
            self.assertTrue(page.order(do="power", node=node, on=False)["done"])
        wait_for(
            "both are off", WALL_LIMIT_S, lambda: not any(page.nodes[n]["on"] for n in ("1", "2"))
        )
        lost = "the gateway to have no route to them"
        wait_for(lost, WALL_LIMIT_S, lambda: page.nodes["0"]["neighbours"] == 0)
        kept = page.order(do="formation", name="kept", places=[[1, 4, 4, 0], [2, 7, 4, 0]])
        self.assertTrue(kept["done"], kept["text"])
        self.assertIn("no route yet to drones 1..2", kept["text"])
        for node in (1, 2):
            self.assertTrue(page.order(do="power", node=node, on=True)["done"])
        wait_for(
            "both at their places",
            WALL_LIMIT_S,
            lambda: (
                [page.nodes[n]["position"] for n in ("1", "2")]
                == [[4.0, 4.0, 0.0], [7.0, 4.0, 0.0]]
            ),
        )

    def test_2_what_cannot_be_done_is_answered_in_words(self) -> None:
        page = open_page()
        unknown = page.order(do="layout", case=77)
        self.assertFalse(unknown["done"])
        self.assertIn("unknown case 77", unknown["text"])
        absent = page.order(do="power", node=200, on=False)
        self.assertFalse(absent["done"])
        self.assertIn("no answer from /Nodes/200/powerSwitch", absent["text"])

    def test_3_packets_of_the_air_are_sampled_while_a_page_shows_them(self) -> None:
        def subscribers() -> list[str]:
            _publishers, subscribers, _services = rosgraph.Master("/test").getSystemState()
            return dict(subscribers).get("/mesh/packets", [])

        page = open_page()
        self.assertEqual(subscribers(), [])
        page.ask(do="packets", on=True)
        wait_for(
            "a heartbeat between two nodes",
            WALL_LIMIT_S,
            lambda: any(
                dot[2] == "heartbeat" and {dot[0], dot[1]} <= {0, 1, 2} and dot[0] != dot[1]
                for message in list(page.packets)
                for dot in message["dots"]
            ),
        )
        page.ask(do="packets", on=False)
        wait_for("no subscriber is left", WALL_LIMIT_S, lambda: subscribers() == [])

    def test_5_a_token_is_in_its_file_and_in_no_parameter_and_no_argument(self) -> None:
        with tempfile.NamedTemporaryFile("w") as file:
            Path(file.name).chmod(0o600)
            file.write(TOKEN)
            file.flush()
            console = subprocess.Popen(
                [*program("console", *CONSOLE), f"_token_file:={file.name}"],
                stdout=subprocess.PIPE,
                text=True,
            )
            try:
                assert console.stdout is not None
                line = console.stdout.readline()
                url = re.findall(r"http://127\.0\.0\.1:\d+/", line)[0]
                self.assertIn(f"the content of {file.name}", line)
                with self.assertRaises(HTTPError):
                    urlopen(url, timeout=5)
                with urlopen(f"{url}static/app.js?token={TOKEN}", timeout=5) as answer:
                    self.assertEqual(answer.status, 200)
                self.assertNotIn(TOKEN, str(rospy.get_param("/")))
                for process in psutil.process_iter(["cmdline"]):
                    self.assertNotIn(TOKEN, " ".join(process.info["cmdline"] or ()))
            finally:
                console.terminate()
                console.communicate()

    def test_6_a_token_in_a_parameter_is_refused(self) -> None:
        console = run_program("console", *CONSOLE, f"_token:={TOKEN}")
        rospy.delete_param("/guarded_console/token")
        self.assertNotEqual(console.returncode, 0)
        self.assertIn("give token_file", console.stderr)
        self.assertNotIn(TOKEN, console.stderr)

    def test_8_events_alarms_charts_and_orders_outlive_the_console(self) -> None:
        page = open_page()
        wait_for("two connected routers", WALL_LIMIT_S, page.all_connected)
        self.assertTrue(page.order(do="speed", paused=False, factor=10)["done"])
        far = page.order(do="formation", name="far", places=[[2, 55, 0, 0]])
        self.assertTrue(far["done"], far["text"])
        self.assertIn("drone 2 would have no route there", far["text"])

        def alarms(of: list[dict]) -> list[tuple]:
            return [(a["text"], a["nodes"], a["since"]) for a in of if 2 in a["nodes"]]

        wait_for("an alarm about 2", WALL_LIMIT_S, lambda: alarms(page.alarms))
        self.assertTrue(page.order(do="speed", paused=True, factor=0)["done"])
        wait_for("paused", WALL_LIMIT_S, lambda: page.clock["paused"])

        def is_saved() -> bool:
            memory = read_memory(MEMORY)
            book = AlarmBook()
            book.restore(memory.saved["alarms"] if memory else {"alarms": [], "was_connected": []})
            return (
                memory is not None
                and len(memory.events) == len(page.events)
                and alarms(book.groups()) == alarms(page.alarms)
            )

        wait_for("all of it to be saved", WALL_LIMIT_S, is_saved)
        kill_and_wait_for_respawn("/mesh_console")
        again = open_page()
        with urlopen(f"http://{HOST}/", timeout=5) as answer:
            self.assertIn(b"<title>Drone mesh</title>", answer.read())
        wait_for("the alarms", WALL_LIMIT_S, lambda: alarms(again.alarms) == alarms(page.alarms))
        self.assertEqual(again.events[: len(page.events)], page.events)
        self.assertAlmostEqual(again.samples[0]["stamp_s"], page.samples[0]["stamp_s"], delta=10.0)
        self.assertEqual(again.nodes["2"]["order"], page.nodes["2"]["order"])
        self.assertIn("to x 55.00 m", again.nodes["2"]["order"])
        self.assertEqual(again.clock["layouts"], page.clock["layouts"])
        self.assertIn("far: ", again.clock["layouts"][-1])

    def test_9_what_an_earlier_run_has_left_is_not_shown(self) -> None:
        wait_for("something saved", WALL_LIMIT_S, lambda: read_memory(MEMORY) is not None)
        pid = pid_of("/mesh_console")
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        with sqlite3.connect(str(MEMORY)) as database:  # before its respawn
            self.assertEqual(database.execute("UPDATE about SET run = 'another'").rowcount, 1)
        database.close()
        wait_for("the respawn", WALL_LIMIT_S, lambda: pid_of("/mesh_console") not in (None, pid))
        page = open_page()
        self.assertTrue(page.clock["paused"])  # by the test before: there is nothing new to show
        self.assertEqual((page.events, page.alarms, page.samples), ([], [], []))
        self.assertTrue(page.order(do="speed", paused=False, factor=3)["done"])
