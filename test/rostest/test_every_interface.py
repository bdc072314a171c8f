#!/usr/bin/env python3
"""Every topic, service and action that a page documents is used once, and its answer compared.

What is used notes its name and type; the last tests compare these with the tables of the pages and
with what the nodes offer.
"""

from __future__ import annotations

import math
import re
import unittest
from collections import defaultdict
from pathlib import Path
from typing import Any

import actionlib
import rosgraph
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock, Log
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, wait_for
from std_msgs.msg import Bool, Float32, String

from drone_mesh import msg, srv
from drone_mesh.ros.graph.resting_clock import RestingClock

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "docs/ros.md", "docs/observing.md", "docs/data.md")
ROW = re.compile(r"^\| (`/[^|]*`) \| ([^|]+) \|", re.MULTILINE)
OF_ACTIONLIB = re.compile(r"/(goal|cancel|status|feedback|result)$")
OF_ROSPY = re.compile(r"/(get_loggers|set_logger_level)$|^/rosout|^/tf")
STARTS = {0: (-1, 0), 1: (0, 0), 2: (6, 0), 3: (0, 6), 4: (6, 6), 5: (0, 12), 6: (6, 12)}  # x, y
ROUTERS = (1, 2, 3, 4)  # those that do not crash
LAYOUT = {1: (-4, 3), 2: (2, 4), 4: (4, 9)}  # case 31
RANGE_M = 9.0
SPEED_M_S = 2.0


def any_id(name: str) -> str:
    """A name as the pages write it: /Nodes/<id>/debug."""
    return re.sub(r"/(Nodes?|Drones)/\d+", r"/\1/<id>", name)


def documented() -> dict[str, set[str]]:
    """The names in the tables of the pages, each with the types that its row names."""
    found: dict[str, set[str]] = defaultdict(set)
    for page in PAGES:
        for names, types in ROW.findall((ROOT / page).read_text()):
            for name in re.findall(r"`(/[^`]+)`", names):
                found[name].update(re.findall(r"[\w/]+", types))
    return found


def neighbours(node: int) -> list[int]:
    """Who is in range at the start."""
    return [n for n in STARTS if n != node and math.dist(STARTS[n], STARTS[node]) < RANGE_M]


class EveryInterfaceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_every_interface")
        cls.log = LogWatch()
        cls.used: dict[str, str] = {}
        cls.heard: dict[str, list[Any]] = defaultdict(list)
        cls.topics: dict[str, rospy.Subscriber] = {}
        cls.mesh = MeshWatch(7, every_tick=True)
        cls.listen("/mesh/state", msg.MeshState)
        cls.listen("/mesh/events", msg.MeshEvent)
        cls.listen("/DroneManager/layouts", msg.LayoutProgress)
        # Early: a subscriber counts a connection before the publisher sends it anything.
        cls.listen("/Nodes/0/received", msg.ReceivedData)
        for node in STARTS:
            cls.used[any_id(f"/Nodes/{node}/debug")] = "NodeDebugInfo"
        cls.mesh.wait("all connected", 60, cls.mesh.connected)

    def setUp(self) -> None:
        self.mesh.wait("all connected", 60, self.mesh.connected)

    @classmethod
    def note(cls, name: str, of: type) -> None:
        cls.used[any_id(name)] = of._type.replace("drone_mesh/", "")

    @classmethod
    def listen(cls, name: str, of: type) -> None:
        """Keep what is published from now on; returns when a publisher is connected."""
        cls.note(name, of)
        cls.topics[name] = topic = rospy.Subscriber(name, of, cls.heard[name].append)
        wait_for(f"a publisher of {name}", WALL_LIMIT_S, lambda: topic.get_num_connections() > 0)

    def leave(self, *names: str) -> None:
        """Listen no more: busy topics cost both sides time."""
        for name in names:
            self.topics.pop(name).unregister()

    def wait_heard(self, name: str, **fields: object) -> Any:
        """The first message with these fields that was or will be heard."""

        def matching() -> list[Any]:
            return [
                message
                for message in list(self.heard[name])
                if all(getattr(message, key) == value for key, value in fields.items())
            ]

        wait_for(f"{name} with {fields}", WALL_LIMIT_S, matching)
        return matching()[0]

    def publisher(self, name: str, of: type) -> rospy.Publisher:
        self.note(name, of)
        topic = rospy.Publisher(name, of, queue_size=10, latch=True)
        wait_for(f"a subscriber of {name}", WALL_LIMIT_S, lambda: topic.get_num_connections() > 0)
        return topic

    def ask(self, service: str, of: type, **fields: object) -> Any:
        self.note(service, of)
        return call(service, of, *(fields[slot] for slot in of._request_class.__slots__))

    def node(self, node: int) -> Any:
        return next(n for n in self.heard["/mesh/state"][-1].nodes if n.id == node)

    def stands_at(self, node: int, x: float, y: float) -> bool:
        """Whether it rests there."""
        now = self.node(node)
        return not now.path and math.dist(now.position, (x, y, 0.0)) < 0.5

    def wait_at(self, node: int, x: float, y: float) -> None:
        self.mesh.wait(f"drone {node} at ({x}, {y})", 90, lambda: self.stands_at(node, x, y))

    def wait_connected(self) -> None:
        """Return when the state shows it, too, by which the drone manager goes."""

        def are_connected() -> bool:
            nodes = self.heard["/mesh/state"][-1].nodes
            return self.mesh.connected() and all(node.connected for node in nodes if node.id)

        self.mesh.wait("all connected after it", 60, are_connected)

    def wait_over(self, number: int) -> Any:
        over = self.wait_heard("/DroneManager/layouts", id=number, over=True)
        self.wait_connected()
        return over

    # The mesh at rest --------------------------------------------------------------------------

    def test_00_what_the_mesh_publishes_at_rest(self) -> None:
        self.listen("/debug", msg.NodeDebugInfo)
        self.listen("/diagnostics", DiagnosticArray)
        self.listen("/mesh/reports", msg.HostReport)
        self.listen("/mesh/progress", msg.HostProgress)
        self.listen("/clock", Clock)
        self.listen("/DroneFactory/real_time_factor", Float32)
        self.listen("/WirelessSignalSimulator", msg.DroneInfo)
        for node, (x, y) in STARTS.items():
            self.assertEqual(self.wait_heard("/debug", nodeID=node).ConnectedWithGateway, True)
            antenna = self.wait_heard("/WirelessSignalSimulator", nodeID=node, sub=f"/Node/{node}")
            self.assertTrue(antenna.on)
            engine = self.wait_heard("/WirelessSignalSimulator", nodeID=node, sub="")
            self.assertLess(math.dist(engine.position[:2], (x, y)), 0.3)
            self.assertTrue(self.stands_at(node, x, y))
        for host, nodes in (("/mesh_host_1", [0, 1, 2]), ("/mesh_host_2", [3, 4, 5, 6])):
            self.assertEqual(
                [n.id for n in self.wait_heard("/mesh/reports", host=host).nodes], nodes
            )
            done = self.wait_heard("/mesh/progress", host=host).done
            self.mesh.wait(
                "its progress", 5, lambda d=done: self.heard["/mesh/progress"][-1].done > d
            )
        self.mesh.wait("a second", 5, lambda: len(self.heard["/clock"]) > 100)
        ticks = [tick.clock.to_sec() for tick in self.heard["/clock"][:100]]
        steps = [after - before for before, after in zip(ticks, ticks[1:])]
        self.assertAlmostEqual(min(steps), 0.01, places=6)
        factors = self.heard["/DroneFactory/real_time_factor"]  # 0: a busy machine stood for 1 s
        wait_for("the factor", WALL_LIMIT_S, lambda: any(factor.data > 0.0 for factor in factors))
        self.mesh.wait(
            "diagnostics without trouble",
            60,
            lambda: any(
                status.name == "drone_mesh: mesh" and status.level == 0
                for array in self.heard["/diagnostics"]
                for status in array.status
            ),
        )
        self.leave("/debug", "/mesh/progress", "/clock", "/WirelessSignalSimulator")
        RestingClock()

    def test_01_the_simulator_carries_packets_while_nobody_jams_them(self) -> None:
        self.listen("/Node/2", msg.NRF24)
        near = self.ask("/SignalSimulator/othersinRange", srv.AreaScan, id=1).near
        self.assertEqual(list(near), neighbours(1))
        packet = bytes((1, 1, 200, 2, 2)).ljust(32, b"\x07")
        hop = {"from": 1, "to": 2, "message": msg.NRF24(packet)}

        def send() -> bool:
            self.note("/SignalSimulator/message", srv.WirelessMessage)
            answer = call("/SignalSimulator/message", srv.WirelessMessage, *hop.values())
            return bool(answer.succes)

        self.assertTrue(send())
        self.wait_heard("/Node/2", payload=packet)
        joined = packet + bytes((1, 1, 200, 99, 99)).ljust(32, b"\0")
        self.note("/SignalSimulator/messages", srv.WirelessMessages)
        taken = call("/SignalSimulator/messages", srv.WirelessMessages, 1, joined).succes
        self.assertEqual(list(taken), [True, False])
        self.note("/SignalSimulator/broadcast", srv.Broadcast)
        to_all = msg.NRF24(bytes((1, 1, 200, 254, 254)).ljust(32, b"\x07"))
        reached = call("/SignalSimulator/broadcast", srv.Broadcast, 1, to_all).reached
        self.assertEqual(list(reached), neighbours(1))
        jammer = self.publisher("/jammer", Bool)
        jammer.publish(True)
        wait_for("a packet is jammed", WALL_LIMIT_S, lambda: not send())
        jammer.publish(False)
        wait_for("a packet arrives", WALL_LIMIT_S, send)
        self.leave("/Node/2")

    def test_02_packets_are_sampled(self) -> None:
        self.listen("/mesh/packets", msg.PacketSample)
        self.mesh.wait(
            "a sample", 30, lambda: any(len(sample.types) for sample in self.heard["/mesh/packets"])
        )
        sample = next(sample for sample in self.heard["/mesh/packets"] if len(sample.types))
        self.assertLessEqual(set(sample.senders) | set(sample.receivers), set(STARTS))
        self.assertGreaterEqual(sample.carried, len(sample.types))
        self.leave("/mesh/packets")

    def test_03_a_message_reaches_the_gateway(self) -> None:
        sent = self.ask(
            "/Nodes/4/send",
            srv.SendData,
            to=255,
            port=7,
            reliable=True,
            payload=b"hello",
            wait=20.0,
        )
        self.assertTrue(sent.success, sent.message)
        received = self.wait_heard("/Nodes/0/received", sender=4, port=7)
        self.assertEqual(received.payload, b"hello")

    def test_04_drones_that_meet_are_grounded(self) -> None:
        self.listen("/Drones/grounded", msg.GroundedDrones)
        goals = {drone: self.publisher(f"/Drones/{drone}/goal", msg.Location) for drone in (5, 6)}
        for drone, other in ((5, 6), (6, 5)):
            x, y = STARTS[other]
            goals[drone].publish(msg.Location(latitude=y, longitude=x, height=0))
        grounded = self.wait_heard("/Drones/grounded")
        self.assertEqual(set(grounded.reasons), {"crashed"})
        self.assertLessEqual(set(grounded.ids), {5, 6})
        drone = grounded.ids[0]
        self.wait_heard("/mesh/events", node=drone, kind="crashed")
        self.mesh.wait("the state", 60, lambda: self.node(drone).why_not_fly == "crashed")
        self.mesh.wait("the diagnostics", 60, lambda: self.trouble(drone).startswith("crashed"))
        goals[drone].publish(msg.Location(latitude=3.0, longitude=3.0, height=0))
        why = "the drone cannot fly: crashed"
        self.wait_heard("/mesh/events", node=drone, kind="goal refused", detail=why)

    def trouble(self, node: int) -> str:
        """Of a node, in the latest diagnostics of the mesh."""
        of = [s for array in self.heard["/diagnostics"] for s in array.status]
        return next((s.message for s in of[::-1] if s.name == f"drone_mesh: node {node}"), "")

    # Orders ------------------------------------------------------------------------------------

    def test_10_one_drone_is_ordered_to_a_place(self) -> None:
        self.listen("/gateway", msg.RequestGatewayDroneFlight)
        self.listen("/gateway/shared_place", msg.RequestGatewayDroneFlight)
        self.listen("/gateway/answers", msg.FlightOrderAnswer)
        self.listen("/Drones/1/goal", msg.Location)
        place = {"latitude": 3.0, "longitude": -4.0, "height": 0}
        for name in ("/DroneManager/requestDroneMovement", "/requestDroneMovement"):
            for heard in ("/gateway", "/gateway/answers", "/Drones/1/goal"):
                self.heard[heard].clear()
            status = self.ask(name, srv.RequestDroneFlight, ID=1, **place).status
            self.assertEqual(status, 1)
            self.wait_heard("/gateway", ID=1, **place)
            self.wait_heard("/gateway/answers", drone=1, outcome=msg.FlightOrderAnswer.SENT)
            self.wait_heard("/Drones/1/goal", **place)
            self.wait_at(1, place["longitude"], place["latitude"])
            arrived = self.wait_heard("/mesh/events", code=msg.MeshEvent.ORDER_ARRIVED)
            self.assertEqual(arrived.peers, bytes([1]))
            place = {"latitude": 0.0, "longitude": 0.0, "height": 0}
            self.wait_connected()
        name = "/DroneManager/orderFlight"
        taken = {"id": 1, "latitude": 6.0, "longitude": 6.0, "height": 0}
        with self.assertRaisesRegex(rospy.ServiceException, "drone 4"):
            self.ask(name, srv.OrderFlight, **taken, allow_shared_place=False)
        free = {"id": 1, "latitude": 1.0, "longitude": 1.0, "height": 0}
        answer = self.ask(name, srv.OrderFlight, **free, allow_shared_place=True)
        self.assertEqual((answer.success, answer.message), (True, ""))
        self.wait_heard("/gateway/shared_place", ID=1, latitude=1.0, longitude=1.0)
        self.wait_at(1, 1.0, 1.0)
        gps = self.ask("/Drones/1/gps", srv.RequestGPS)
        self.assertLess(math.dist((gps.longitude, gps.latitude), (1.0, 1.0)), 0.5)
        self.assertEqual(gps.height, 0)

    def test_11_a_preview_says_what_the_order_does(self) -> None:
        name = "/DroneManager/previewLayout"
        found = self.ask(name, srv.PreviewLayout, caseID=31, at_once=False)
        self.assertEqual(found.not_in_fleet, bytes([9]))
        self.assertEqual((found.out_of_reach, found.cut_off, found.stay), (b"", b"", b""))
        together = self.ask(name, srv.PreviewLayout, caseID=31, at_once=True)
        ways = [math.dist(self.node(n).position, (*place, 0.0)) for n, place in LAYOUT.items()]
        self.assertAlmostEqual(together.duration, max(ways) / SPEED_M_S, delta=0.1)
        self.assertGreater(found.duration, together.duration)
        lost = self.ask(name, srv.PreviewLayout, caseID=33, at_once=True)
        self.assertEqual(lost.out_of_reach, bytes([4]))
        self.assertIn("1 drone would be out of reach: 4", lost.message)
        begun_s = rospy.get_time()
        name = "/DroneManager/orderLayout"
        answer = self.ask(name, srv.OrderLayout, caseID=31, at_once=False)
        self.assertEqual(sorted(answer.sent + answer.later), sorted(LAYOUT))
        self.assertEqual(answer.not_in_fleet, bytes([9]))
        over = self.wait_heard("/DroneManager/layouts", id=answer.id, over=True)
        self.assertEqual((over.arrived, over.not_in_fleet), (bytes(LAYOUT), bytes([9])))
        self.assertGreater(rospy.get_time() - begun_s, found.duration)
        for drone, place in LAYOUT.items():
            self.wait_at(drone, *place)

    def test_12_layouts_and_formations_are_ordered_and_withdrawn(self) -> None:
        for name, case, drone, place in (
            ("/DroneManager/SetToCasus", 32, 4, STARTS[4]),
            ("/SetToCasus", 31, 4, LAYOUT[4]),
        ):
            self.ask(name, srv.Casus, caseID=case)
            self.wait_at(drone, *place)
            self.wait_connected()
        places = [msg.Location(*STARTS[drone][::-1], 0) for drone in LAYOUT]
        name = "/DroneManager/orderFormation"
        formation = {"name": "back", "drones": bytes(LAYOUT), "places": places}
        formation.update(at_once=False, gateways=b"")
        answer = self.ask(name, srv.OrderFormation, **formation)
        self.assertEqual(sorted(answer.sent + answer.later), sorted(LAYOUT), answer.message)
        over = self.wait_over(answer.id)
        self.assertEqual((over.name, over.arrived), ("back", bytes(LAYOUT)))
        again = self.ask(name, srv.OrderFormation, **formation)
        self.assertEqual((again.there, again.sent, again.later), (bytes(LAYOUT), b"", b""))
        words = "ordered 0 of 3 drones; drones 1..2, 4 are at their places"
        self.assertEqual(again.message, words)
        wait_for("its line", WALL_LIMIT_S, lambda: self.log.lines(f"back: {words}"))
        self.assertEqual(self.log.lines("back: ", Log.WARN), [])
        name = "/DroneManager/orderLayout"
        answer = self.ask(name, srv.OrderLayout, caseID=31, at_once=False)
        name = "/DroneManager/withdrawLayout"
        self.assertTrue(self.ask(name, srv.WithdrawLayout, id=answer.id).success)
        self.assertFalse(self.ask(name, srv.WithdrawLayout, id=answer.id).success)
        self.assertLess(len(self.wait_over(answer.id).arrived), len(LAYOUT))

    def test_12_places_too_near_to_each_other_are_refused_by_every_kind_of_order(self) -> None:
        why = "drones 1 and 2 would stand 0.50 m apart: the clearance is 1 m"
        for name, of, fields in (
            ("/DroneManager/orderLayout", srv.OrderLayout, {"at_once": False}),
            ("/DroneManager/orderLayout", srv.OrderLayout, {"at_once": True}),
            ("/DroneManager/previewLayout", srv.PreviewLayout, {"at_once": True}),
            ("/DroneManager/SetToCasus", srv.Casus, {}),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, why):
                self.ask(name, of, caseID=34, **fields)
        client = actionlib.SimpleActionClient("/DroneManager/layout", msg.LayoutAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(60)), "no action")
        client.send_goal_and_wait(msg.LayoutGoal(34, True))
        self.assertEqual(client.get_state(), GoalStatus.ABORTED)
        self.assertIn(why, client.get_result().message)

    def test_13_actions_end_with_the_drones_at_their_places(self) -> None:
        for name, action, goal in (
            ("/DroneManager/layout", msg.LayoutAction, msg.LayoutGoal(32, False)),
            ("/Drones/3/fly", msg.FlyAction, msg.FlyGoal(latitude=7.0, longitude=-1.0, height=0)),
        ):
            self.used[any_id(name)] = action._type[: -len("Action")].replace("drone_mesh/", "")
            client = actionlib.SimpleActionClient(name, action)
            self.assertTrue(client.wait_for_server(rospy.Duration(60)), name)
            client.send_goal_and_wait(goal)
            self.assertEqual(
                client.get_state(), GoalStatus.SUCCEEDED, client.get_goal_status_text()
            )
            self.wait_connected()
        self.assertEqual(client.get_result().outcome, msg.FlyResult.ARRIVED)
        self.wait_at(3, -1.0, 7.0)
        for drone in LAYOUT:
            self.assertTrue(self.stands_at(drone, *STARTS[drone]))

    def test_14_all_keep_a_fence_that_changes(self) -> None:
        self.listen("/DroneManager/fence", String)
        name, order = "/DroneManager/setFence", "/DroneManager/orderFlight"
        yard = "areas: [{name: yard, polygon: [[-9, -9], [20, -9], [20, 20], [-9, 20]]}]"
        pond = '{"areas": [{"name": "pond", "inclusion": false, "center": [14, 0], "radius": 2}]}'
        near = yard.replace("-9", "-4").replace("yard", "near")
        change = {"areas": "", "keep": False, "remove": []}

        def fly(x: float, y: float) -> Any:
            place = {"longitude": x, "latitude": y, "height": 0, "allow_shared_place": True}
            return self.ask(order, srv.OrderFlight, id=1, **place)

        told = self.ask(name, srv.SetFence, **{**change, "areas": yard})
        self.assertEqual(told.message, "fence: yard")
        told = self.ask(name, srv.SetFence, **{**change, "areas": pond, "keep": True})
        self.assertEqual(told.message, "fence: yard, pond")
        with self.assertRaisesRegex(rospy.ServiceException, "inside fence pond"):
            self.mesh.wait("its refusal", 30, lambda: not fly(14.0, 0.0).success)
        self.assertTrue(fly(-8.0, 0.0).success)
        self.mesh.wait("it flies", 60, lambda: self.node(1).position[2] > 1.0)
        self.ask(name, srv.SetFence, **{**change, "areas": near})
        given_up = self.wait_heard("/mesh/events", code=msg.MeshEvent.ORDER_GIVEN_UP)
        self.assertIn("outside fence near", given_up.detail)
        published = self.heard["/DroneManager/fence"][-1].data
        names = [area.name for area in self.heard["/mesh/state"][-1].fence]
        self.assertEqual(names, ["near"])
        self.assertGreater(self.node(1).position[0], -4.5)
        for wrong, words in (
            ({"remove": ["sea"], "keep": True}, "no area sea"),
            ({"remove": ["near"]}, "remove goes with keep"),
            ({"areas": "areas: [{name: sea}]"}, "expected a polygon"),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, words):
                self.ask(name, srv.SetFence, **{**change, **wrong})
        self.assertEqual(self.ask(name, srv.SetFence, **change).message, "fence: none")
        self.mesh.wait("no fence", 30, lambda: not self.heard["/mesh/state"][-1].fence)
        for told, words in (published, "fence: near"), ('{"areas": []}', "fence: none"):
            again = self.ask(name, srv.SetFence, **{**change, "areas": told})
            self.assertEqual(again.message, words)
            self.wait_heard("/DroneManager/fence", data=told)
        self.wait_connected()
        self.assertTrue(fly(*STARTS[1]).success)
        self.wait_at(1, *STARTS[1])

    # Switches ----------------------------------------------------------------------------------

    def test_20_a_node_without_power_is_off(self) -> None:
        for power in (False, True):
            self.ask("/Nodes/4/powerSwitch", srv.PowerSwitch, power=power)
            self.mesh.wait(f"power {power}", 30, lambda on=power: self.mesh.info(4).on is on)

    def test_22_time_stands_still_and_goes_on(self) -> None:
        name = "/DroneFactory/setSpeed"
        self.assertTrue(self.ask(name, srv.SetSpeed, paused=True, real_time_factor=0.0).success)
        states = self.heard["/mesh/state"]
        states.clear()
        wait_for(
            "two states of the same moment",
            WALL_LIMIT_S,
            lambda: (
                len(states) > 1
                and states[-1].paused
                and states[-1].header.stamp == states[-2].header.stamp
            ),
        )
        self.assertTrue(self.ask(name, srv.SetSpeed, paused=False, real_time_factor=8.0).success)
        wait_for("it goes on", WALL_LIMIT_S, lambda: not states[-1].paused)

    def test_23_a_pilot_flies_a_mission_until_it_is_told_to_stop(self) -> None:
        name = "/Drones/3/mission"
        way = [msg.Location(9.0, 5.0, 3), msg.Location(7.0, -1.0, 3)]
        fly = {"waypoints": way, "speed": 2.0, "loop": True}
        begun = self.ask(name, srv.FlyMission, action=srv.FlyMissionRequest.FLY, **fly)
        self.assertTrue(begun.success, begun.message)
        self.mesh.wait("its pilot climbs", 60, lambda: self.node(3).position[2] > 2.0)
        self.mesh.wait("its pilot goes across", 60, lambda: self.node(3).position[0] > 2.0)
        for action in (srv.FlyMissionRequest.PAUSE, srv.FlyMissionRequest.STOP):
            told = self.ask(name, srv.FlyMission, action=action, waypoints=[], speed=0, loop=False)
            self.assertTrue(told.success, told.message)
        resume = srv.FlyMissionRequest.RESUME
        gone = self.ask(name, srv.FlyMission, action=resume, waypoints=[], speed=0, loop=False)
        self.assertFalse(gone.success)

    def test_24_the_routers_leave_a_gateway_without_internet_for_one_that_is_added(self) -> None:
        where = {"latitude": 3.0, "longitude": 2.0}
        added = self.ask("/DroneFactory/addDrone", srv.AddDrone, id=255, gateway=True, **where)
        self.assertEqual((added.success, added.id), (True, 7), added.message)
        self.mesh.wait("7 in the mesh", 60, lambda: self.has_node(7))

        def all_prefer(gateway: int) -> bool:
            return all(self.mesh.info(n).prefferedGateWay == gateway for n in ROUTERS)

        for off, other in ((0, 7), (7, 0)):
            self.ask(f"/Nodes/{off}/internetSwitch", srv.PowerSwitch, power=False)
            self.mesh.wait(f"all prefer {other}", 90, lambda to=other: all_prefer(to))
            self.ask(f"/Nodes/{off}/internetSwitch", srv.PowerSwitch, power=True)
        removed = self.ask("/DroneFactory/removeDrone", srv.RemoveDrone, id=7)
        self.assertTrue(removed.success, removed.message)
        self.mesh.wait("7 gone", 60, lambda: not self.has_node(7))

    def has_node(self, node: int) -> bool:
        return any(n.id == node for n in self.heard["/mesh/state"][-1].nodes)

    # What is documented ------------------------------------------------------------------------

    def test_98_every_documented_interface_was_used_and_has_the_documented_type(self) -> None:
        pages = documented()
        self.assertEqual(sorted(pages.keys() - self.used.keys()), [], "no test uses these")
        self.assertEqual(sorted(self.used.keys() - pages.keys()), [], "in no table of a page")
        for name, kind in self.used.items():
            self.assertIn(kind, pages[name], name)

    def test_99_every_interface_that_the_nodes_offer_is_documented(self) -> None:
        publishers, subscribers, services = rosgraph.Master("/test").getSystemState()
        offered = {any_id(name) for name, _nodes in publishers + subscribers + services}
        own = {name for name in offered if not OF_ROSPY.search(name)}
        names = {name if name in self.used else OF_ACTIONLIB.sub("", name) for name in own}
        self.assertEqual(sorted(names - documented().keys()), [])
        self.assertEqual(self.log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "every_interface", EveryInterfaceTest)
