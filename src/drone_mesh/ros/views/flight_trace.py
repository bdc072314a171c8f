"""rosrun drone_mesh flight_trace: the positions in a recording, as a trace or on the earth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Sequence, Tuple

import rospy

from drone_mesh.arguments import ArgumentParser
from drone_mesh.earth_files import WRITERS, tracks_of
from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.mobility.trace_files import write_csv
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.graph.parameters import earth_origin
from drone_mesh.ros.views.bag import BagUnusable, RecordedMesh
from drone_mesh.ros.views.state_source import add_run
from drone_mesh.state.model import known_positions

Position = Tuple[float, int, Sequence[float]]
"""Seconds, the node, and x, y, z in metres."""


def main() -> None:
    parser = ArgumentParser(
        prog="rosrun drone_mesh flight_trace",
        description="Writes the positions in a recording as CSV (t,id,x,y,z; seconds from its "
        "start, metres), which mobility of kind trace replays, or as tracks in GeoJSON or KML.",
        epilog="Exit code: 0 written, 2 failed.",
    )
    parser.add_argument("bag", type=Path, help="a recording of /mesh/state, or a gateway's record")
    parser.add_argument(
        "trace", type=Path, help="the file to write: FILE.geojson, FILE.kml, or else CSV"
    )
    parser.add_argument(
        "--origin",
        default="",
        metavar="LAT,LON,ALT",
        help="where x 0, y 0 is on the earth, for GeoJSON and KML (default: that of the gateway "
        "in its record)",
    )
    add_run(parser)
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("flight_trace", lambda: _run(options))


def positions_in(recorded: RecordedMesh, run: int | None) -> list[Position]:
    """Each known position of each drone in a run, in seconds from its start. Raises BagUnusable."""
    positions: list[Position] = []
    number, start_s = 0, 0.0
    for this, state in recorded.by_run():
        if run is None or this == run:
            if this != number:
                positions, start_s = [], state.stamp_s
            for stamp_s, node, place in known_positions([state]):
                positions.append((stamp_s - start_s, node, place))
        number = this
    recorded.chosen_run(number, run)
    return positions


def _run(options: argparse.Namespace) -> int:
    recorded, trace = RecordedMesh(options.bag), options.trace
    write_earth = WRITERS.get(trace.suffix.lower().lstrip("."))
    given = options.origin
    origin = earth_origin(given, is_live=False) if given else RecordedMesh(options.bag).origin()
    if write_earth and origin is None:
        raise ConfigurationError(f"{trace}: needs --origin LAT,LON,ALT: where x 0, y 0 is")
    positions = positions_in(recorded, options.run)
    if not positions:
        raise BagUnusable(f"{options.bag}: no position of a drone is known")
    try:
        if write_earth and origin is not None:
            trace.write_text(write_earth(tracks_of(positions), origin), encoding="utf-8")
        else:
            write_csv(trace, ((at_s, node, x, y, z) for at_s, node, (x, y, z) in positions))
    except OSError as error:
        raise MeshError(f"{trace}: {error.strerror}") from error
    drones = len({node for _at_s, node, _place in positions})
    print(f"{trace}: {drones} drones, {positions[-1][0]:.1f} s")
    recorded.raise_damage()
    return 0
