"""rosrun drone_mesh lab_run: shows a run of the lab in rviz; `lab show RUN --rviz` starts it."""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import tempfile
from pathlib import Path

import rospy

from drone_mesh.lab.results import load_results
from drone_mesh.lab.show import explain_hash, replay
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.views.bag import write_bag


def main() -> None:
    """Entry point of nodes/lab_run."""
    options = _parser().parse_args(rospy.myargv()[1:])
    run_tool("lab_run", lambda: _run(options))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh lab_run",
        description="Repeats a run of the lab and plays it in rviz, one state per sample. Starts a "
        "master if none is running; needs a screen.",
        epilog="Ctrl-C ends it. Exit code: that of roslaunch; 2: no such run.",
    )
    parser.add_argument("results", type=Path, help="results folder of the experiment")
    parser.add_argument("run_id", metavar="RUN", help="id of the run, or the beginning of it")
    parser.add_argument(
        "--bag", type=Path, metavar="FILE", help="write the run to this bag and do not show it"
    )
    return parser


def _run(options: argparse.Namespace) -> int:
    results = load_results(options.results)
    shown = replay(results, options.run_id)
    print(explain_hash(results, shown), flush=True)
    if options.bag is not None:
        write_bag(options.bag, shown.states, shown.record.events)
        print(f"wrote {options.bag}")
        return 0
    with tempfile.TemporaryDirectory(prefix="lab_run.") as folder:
        bag = Path(folder) / f"{shown.planned.spec.run}.bag"
        write_bag(bag, shown.states, shown.record.events)
        launch = ["roslaunch", "drone_mesh", "replay.launch", f"bag:={bag}"]
        return _wait(subprocess.Popen([*launch, "console:=false", "rviz:=true"]))


def _wait(process: subprocess.Popen[bytes]) -> int:
    """Wait for roslaunch. A terminal sends Ctrl-C to it as well, and it then ends its nodes."""
    while True:
        with contextlib.suppress(KeyboardInterrupt):
            return process.wait()
