"""rosrun drone_mesh report: an HTML report of a recorded run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import rospy

from drone_mesh.errors import MeshError
from drone_mesh.lab.run_report.page import render_page, write_csv
from drone_mesh.lab.run_report.story import NothingRecorded, tell_story
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.views.bag import BagUnusable, RecordedMesh


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh report",
        description="Writes an HTML report of a run that launch/record.launch recorded: the "
        "connected share over time, the outages and their repairs, messages "
        "per node, the map before and after. Needs no running simulation.",
        epilog="Exit code: 0 written, 2 failed.",
    )
    parser.add_argument("bag", type=Path, help="the bag of the recorded run, or a gateway's record")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="HTML",
        help="file of the report (default: beside the bag)",
    )
    parser.add_argument(
        "--csv", type=Path, metavar="FOLDER", help="also write the numbers to this folder, as CSV"
    )
    parser.add_argument("--title", help="heading of the report (default: name of the bag)")
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("report", lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    page = options.output or options.bag.with_suffix(".html")
    print(f"reading {options.bag} ...", file=sys.stderr)
    recorded = RecordedMesh(options.bag)
    try:
        story = tell_story(recorded.states(), recorded.events())
    except NothingRecorded as error:
        raise BagUnusable(f"{options.bag}: {error}") from error
    print("drawing ...", file=sys.stderr)
    html = render_page(story, options.title or options.bag.stem)
    try:
        with page.open("w", encoding="utf-8", errors="backslashreplace") as file:  # of file names
            file.write(html)
        written = [page] + (write_csv(story, options.csv) if options.csv else [])
    except OSError as error:
        raise MeshError(f"{error.filename}: {error.strerror}") from error
    for path in written:
        print(path)
    recorded.raise_damage()
    return 0
