"""The program mesh_trace."""

from __future__ import annotations

import sys
from typing import Sequence

from drone_mesh.stopping import ends_as
from drone_mesh.users import command_line


@ends_as("mesh_trace")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the path to a node; the exit status is 1 if it does not answer."""
    parser = command_line.parser_for("mesh_trace", "Prints the path of packets to a node.")
    command_line.add_echo_arguments(parser)
    parsed = parser.parse_args(arguments)
    answer = command_line.client(parsed).echo(parsed.id, parsed.timeout)
    if not answer["answered"]:
        print(f"mesh_trace: node {parsed.id} does not answer", file=sys.stderr)
        return 1
    for number, hop in enumerate([*answer["route"], parsed.id], start=1):
        print(f"{number:3}  node {hop}")
    print(f"round trip: {1e3 * answer['round_trip_s']:.1f} ms")
    return 0
