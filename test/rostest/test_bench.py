#!/usr/bin/env python3
"""The benchmark starts a fleet, prints plausible figures, and leaves nothing behind."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import psutil
import rostest
from rostest_support import wait_for

FLEET = ["--only", "ros", "--sizes", "5/6"]
STARTED_WITHIN_S = 40.0


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "drone_mesh.bench", *FLEET, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def descendants(process: subprocess.Popen[str]) -> list[psutil.Process]:
    return psutil.Process(process.pid).children(recursive=True)


def names(processes: list[psutil.Process]) -> set[str]:
    found = set()
    for process in processes:
        try:
            found.update(process.cmdline())
        except psutil.NoSuchProcess:
            continue
    return found


class BenchTest(unittest.TestCase):
    def test_a_fleet_is_measured(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            figures = Path(folder, "figures.json")
            # More than a check period, or possibly no node sends anything.
            bench = start("--seconds", "11", "--json", str(figures))
            out, err = bench.communicate(timeout=120)
            self.assertEqual(bench.returncode, 0, err)
            (result,) = json.loads(figures.read_text(encoding="utf-8"))["ros"]
        self.assertEqual((result["drones"], result["routers_connected"]), (5, 4))
        self.assertIn("| 5 |", " ".join(out.split()))
        self.assertLess(result["connected_after_sim_s"], 15.0)
        self.assertGreater(result["messages_per_wall_s"], 0.0)
        self.assertGreater(result["deliveries_per_wall_s"], 0.0)
        self.assertEqual(result["lost_share"], 0.0)
        self.assertGreater(result["reached_real_time_factor"], 0.5)
        self.assertLess(result["reached_real_time_factor"], 1.5)
        self.assertLess(result["worst_timer_lag_s"], 0.05)
        self.assertGreaterEqual(set(result["cores"]), {"DroneFactory", "WirelessSignalSimulator"})
        self.assertGreater(result["pss_mb"], 50.0)

    def test_an_interrupted_benchmark_ends_all_that_it_started(self) -> None:
        bench = start("--seconds", "600")
        wait_for(
            "the benchmark starts its drones",
            STARTED_WITHIN_S,
            lambda: "__name:=DroneFactory" in names(descendants(bench)),
        )
        started = descendants(bench)
        bench.send_signal(signal.SIGINT)
        _out, err = bench.communicate(timeout=60)
        self.assertEqual(bench.returncode, 130)
        self.assertNotIn("Traceback", err)
        wait_for(
            "all that it started has ended",
            5.0,
            lambda: not any(process.is_running() for process in started),
        )


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "bench", BenchTest)
