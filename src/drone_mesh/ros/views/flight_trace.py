"""rosrun drone_mesh flight_trace: the positions in a recording as a trace for experiments."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Iterator

import rospy

from drone_mesh.mobility.trace_files import TraceRow, write_csv
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.views.bag import no_states, read_states
from drone_mesh.ros.views.report import CannotWrite
from drone_mesh.state.model import position_is_known


def main() -> None:
    """Entry point of nodes/flight_trace."""
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh flight_trace",
        description="Writes the positions in a recording as CSV (t,id,x,y,z; seconds from its "
        "start, metres), which mobility of kind trace replays.",
        epilog="Exit code: 0 written, 2 failed.",
    )
    parser.add_argument("bag", type=Path, help="a recording of /mesh/state, or a gateway's record")
    parser.add_argument("trace", type=Path, help="the CSV file to write")
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("flight_trace", lambda: _run(options.bag, options.trace))


def rows_in_bag(path: Path) -> Iterator[TraceRow]:
    """Each known position of each drone. Raises BagUnusable."""
    start_s: float | None = None
    for mesh in read_states(path):
        start_s = mesh.stamp_s if start_s is None else start_s
        for node in mesh.nodes:
            if position_is_known(node):
                x, y, z = node.position
                yield mesh.stamp_s - start_s, node.id, x, y, z


def _run(bag: Path, trace: Path) -> int:
    rows = list(rows_in_bag(bag))
    if not rows:
        raise no_states(bag)
    try:
        write_csv(trace, rows)
    except OSError as error:
        raise CannotWrite(f"{trace}: {error.strerror}") from error
    drones = len({row[1] for row in rows})
    print(f"{trace}: {drones} drones, {rows[-1][0]:.1f} s")
    return 0
