"""rosrun drone_mesh flight_trace: the positions in a recording, as a trace or on the earth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Sequence, Tuple

import rospy

from drone_mesh.earth_files import WRITERS, tracks_of
from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.mobility.trace_files import write_csv
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.graph.parameters import earth_origin
from drone_mesh.ros.views.bag import (
    by_run,
    chosen_run,
    no_states,
    origin_in,
    raise_any,
    read_states,
    readable,
)
from drone_mesh.ros.views.bag_file import BagDamaged, BagUnusable
from drone_mesh.ros.views.state_source import add_run
from drone_mesh.state.model import known_positions

Position = Tuple[float, int, Sequence[float]]
"""Seconds, the node, and x, y, z in metres."""


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
    add_run(parser)
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("flight_trace", lambda: _run(options))


def positions_in_bag(path: Path, run: int | None, damage: list[BagDamaged]) -> list[Position]:
    """Each known position of each drone in a run, in seconds from its start. Raises BagUnusable.

    What is damaged is left out and added to `damage`.
    """
    positions: list[Position] = []
    number, start_s = 0, 0.0
    for this, state in by_run(readable(read_states(path), damage)):
        if this != number and (run is None or this == run):
            positions, start_s = [], state.stamp_s
        if run is None or this == run:
            positions += (
                (stamp_s - start_s, node, place)
                for stamp_s, node, place in known_positions([state])
            )
        number = this
    if not number:
        raise damage[0] if damage else no_states(path)
    chosen_run(path, number, run)
    return positions


def _run(options: argparse.Namespace) -> int:
    bag, trace = options.bag, options.trace
    damage: list[BagDamaged] = []
    write_earth = WRITERS.get(trace.suffix.lower().lstrip("."))
    origin = earth_origin(options.origin, is_live=False) if options.origin else origin_in(bag)
    if write_earth and origin is None:
        raise ConfigurationError(f"{trace}: needs --origin LAT,LON,ALT: where x 0, y 0 is")
    positions = positions_in_bag(bag, options.run, damage)
    if not positions:
        raise BagUnusable(f"{bag}: no position of a drone is known")
    try:
        if write_earth and origin is not None:
            trace.write_text(write_earth(tracks_of(positions), origin), encoding="utf-8")
        else:
            write_csv(trace, ((at_s, node, x, y, z) for at_s, node, (x, y, z) in positions))
    except OSError as error:
        raise MeshError(f"{trace}: {error.strerror}") from error
    drones = len({node for _at_s, node, _place in positions})
    print(f"{trace}: {drones} drones, {positions[-1][0]:.1f} s")
    raise_any(damage)
    return 0
