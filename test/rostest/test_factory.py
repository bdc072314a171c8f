"""The DroneFactory: time, speed, the ROS side of the engines, and an antenna's power switch."""

from __future__ import annotations

import math
import unittest
from pathlib import Path

import numpy as np
import rospy
from rosgraph_msgs.msg import Clock
from rostest_support import LogWatch, MeshWatch, call, pid_of, wait_for

from drone_mesh.msg import DroneInfo, Location
from drone_mesh.ros.graph.resting_clock import RestingClock
from drone_mesh.srv import SetSpeed
from drone_mesh.state.orders import CLOCKS_DIFFER_S


class FactoryTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.log = LogWatch()
        cls.mesh = MeshWatch(3, every_tick=True)
        cls.mesh.wait("the first debug messages", 30, lambda: len(cls.mesh.hops()) == 3)

    def fly(self, node_id: int, latitude: float, longitude: float, height: int) -> None:
        publisher = rospy.Publisher(f"/Drones/{node_id}/goal", Location, queue_size=1)
        wait_for("no subscriber for goals", 10, lambda: publisher.get_num_connections() > 0)
        publisher.publish(Location(latitude, longitude, height))

    def test_clock_goes_in_hundredths_of_a_second(self) -> None:
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 0.5).success)
        self.addCleanup(call, "/DroneFactory/setSpeed", SetSpeed, False, 4.0)
        times: list[int] = []
        clock = rospy.Subscriber("/clock", Clock, lambda tick: times.append(tick.clock.to_nsec()))
        wait_for("no 200 ticks", 20, lambda: len(times) >= 200)
        clock.unregister()
        steps = [b - a for a, b in zip(times[:200], times[1:200])]
        # rospy keeps only the newest of several ticks that arrive at once; slow ones do so rarely.
        self.assertEqual({step % 10_000_000 for step in steps}, {0})
        self.assertGreater(steps.count(10_000_000), 100)

    def test_a_node_that_begins_nothing_with_a_tick_reads_several_at_once(self) -> None:
        self.addCleanup(call, "/DroneFactory/setSpeed", SetSpeed, False, 4.0)
        resting = RestingClock()
        self.addCleanup(resting.stop)
        for factor in (4.0, 1.0):
            self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, factor).success)
            read_s = self.read_for(2.0)
            steps_s = sorted(after - before for before, after in zip(read_s, read_s[1:]))
            self.assertGreater(sum(steps_s) / len(steps_s), 0.03, (factor, steps_s))
            self.assertLess(steps_s[len(steps_s) // 2], CLOCKS_DIFFER_S, (factor, steps_s))

    def read_for(self, simulated_s: float) -> list[float]:
        """The ticks that rospy reads in this time."""
        read_s: list[float] = []
        clock = rospy.Subscriber("/clock", Clock, lambda tick: read_s.append(tick.clock.to_sec()))
        self.addCleanup(clock.unregister)
        self.mesh.wait("ticks", 10, lambda: read_s and read_s[-1] > read_s[0] + simulated_s)
        return read_s

    def test_what_needs_no_numpy_spends_no_time_and_memory_on_it(self) -> None:
        for node in ("/WirelessSignalSimulator", "/fly_actions"):
            libraries = Path(f"/proc/{pid_of(node)}/maps").read_text("utf-8")
            self.assertIn("python", libraries)
            self.assertNotIn("numpy", libraries, node)

    def test_a_speed_out_of_bounds_is_refused_with_the_bounds(self) -> None:
        for factor in (math.nan, math.inf, -1.0, 1e-300, 1e-5, 100_000.0):
            answer = call("/DroneFactory/setSpeed", SetSpeed, False, factor)
            self.assertFalse(answer.success, factor)
            self.assertIn("must be 0.001..1000", answer.message)

    def test_a_new_speed_takes_effect_during_the_wait_for_a_step_at_the_old_one(self) -> None:
        self.addCleanup(call, "/DroneFactory/setSpeed", SetSpeed, False, 4.0)
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 0.001).success)
        stood_s = rospy.get_time()
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 4.0).success)
        # At 0.001 the world makes one step in 10 s.
        wait_for("the clock to go on", 5, lambda: rospy.get_time() > stood_s + 1.0)

    def test_a_goal_is_flown_to_and_told_at_most_20_times_a_second(self) -> None:
        heard: list[DroneInfo] = []
        positions = rospy.Subscriber("/WirelessSignalSimulator", DroneInfo, heard.append)

        def of_the_engine() -> list[DroneInfo]:
            return [info for info in list(heard) if info.nodeID == 2 and not info.sub]

        wait_for("no DroneInfo of the engine for a new subscriber", 10, of_the_engine)
        heard.clear()
        self.fly(2, latitude=3.0, longitude=2.0, height=2)
        goal = (2.0, 3.0, float(np.float32(2.05)))  # of the box's centre
        self.mesh.wait(
            "drone 2 did not arrive",
            10,
            lambda: of_the_engine() and tuple(of_the_engine()[-1].position) == goal,
        )
        positions.unregister()
        self.assertEqual(self.mesh.place(2), (2.0, 3.0, 2))
        self.assertTrue(all(info.on for info in of_the_engine()))
        flight_s = math.dist((6.0, 0.0, 0.05), (2.0, 3.0, 2.05)) / 2.0
        self.assertLessEqual(len(of_the_engine()), 20 * flight_s + 3)
        self.assertGreaterEqual(len(of_the_engine()), 10 * flight_s)

    def test_a_goal_that_is_none_is_refused_with_one_line(self) -> None:
        for _ in range(20):
            self.fly(1, latitude=math.nan, longitude=0.0, height=0)
            self.fly(1, latitude=0.0, longitude=5001.0, height=0)
        wait_for("no line", 10, lambda: self.log.lines("drone 1 refused a goal"))
        self.assertEqual(self.mesh.place(1), (0.0, 0.0, 0))
        self.assertLessEqual(len(self.log.lines("drone 1 refused a goal")), 2)
        self.assertEqual(self.log.failures(), [])
