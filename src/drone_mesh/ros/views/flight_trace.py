"""rosrun drone_mesh flight_trace: the positions in a recording, as a trace or on the earth."""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import Iterator, Sequence

import rospy

from drone_mesh.earth_files import WRITERS, tracks_of
from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.mobility.trace_files import write_csv
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.graph.parameters import earth_origin
from drone_mesh.ros.views.bag import no_states, origin_in, read_states
from drone_mesh.state.model import known_positions


def main() -> None:
    """Entry point of nodes/flight_trace."""
    parser = argparse.ArgumentParser(
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
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("flight_trace", lambda: _run(options.bag, options.trace, options.origin))


def positions_in_bag(path: Path) -> Iterator[tuple[float, int, Sequence[float]]]:
    """Each known position of each drone, in seconds from the start. Raises BagUnusable."""
    states = read_states(path)
    for first in states:
        for stamp_s, node, position in known_positions(itertools.chain([first], states)):
            yield stamp_s - first.stamp_s, node, position


def _run(bag: Path, trace: Path, given: str) -> int:
    write_earth = WRITERS.get(trace.suffix.lower().lstrip("."))
    origin = earth_origin(given, is_live=False) if given else origin_in(bag)
    if write_earth and origin is None:
        raise ConfigurationError(f"{trace}: needs --origin LAT,LON,ALT: where x 0, y 0 is")
    positions = list(positions_in_bag(bag))
    if not positions:
        raise no_states(bag)
    try:
        if write_earth and origin is not None:
            trace.write_text(write_earth(tracks_of(positions), origin), encoding="utf-8")
        else:
            write_csv(trace, ((at_s, node, x, y, z) for at_s, node, (x, y, z) in positions))
    except OSError as error:
        raise MeshError(f"{trace}: {error.strerror}") from error
    drones = len({node for _at_s, node, _place in positions})
    print(f"{trace}: {drones} drones, {positions[-1][0]:.1f} s")
    return 0
