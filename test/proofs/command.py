"""scripts/proofs: attack meshes, send them mutated packets, and count warnings without a reason.

docs/security.md, "Attacks".
"""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path
from typing import Callable, Sequence

from drone_mesh.arguments import MOST, whole
from drone_mesh.errors import MeshError
from drone_mesh.lab.terminal import Progress
from drone_mesh.stopping import ends_as
from proofs.attacks import ATTACKS
from proofs.damage import KEY, TABLE_HEAD, damage_row, keys_of, with_row
from proofs.fuzz import NODES, crowd, fuzz
from proofs.quiet import runs, warnings_of

PROGRAM = "scripts/proofs"


@ends_as(PROGRAM)
def main(argv: Sequence[str] | None = None) -> int:
    """Returns the exit status: 0 done, 1 an error, 2 usage, 130 Ctrl-C."""
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Prove what strangers can do to a mesh, and that a mesh without them warns of "
        "nothing (docs/security.md).",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    attack = commands.add_parser(
        "attack", help="attack meshes without and with a key, and print the damage as a table"
    )
    attack.add_argument(
        "attacks", nargs="*", metavar="ATTACK", help=f"any of: {', '.join(ATTACKS)} (default: all)"
    )
    attack.add_argument(
        "--runs",
        type=whole(1, MOST),
        default=3,
        metavar="N",
        help="number of seeds (default %(default)s)",
    )
    attack.add_argument(
        "--page", type=Path, metavar="FILE", help="also write the rows into the table of this page"
    )
    attack.set_defaults(run=_attack)

    fuzzing = commands.add_parser(
        "fuzz", help="send mutated packets, and those of invented nodes, to a small mesh"
    )
    fuzzing.add_argument(
        "--packets",
        type=whole(0, MOST),
        default=1_000_000,
        metavar="N",
        help="number of packets (default: %(default)s)",
    )
    fuzzing.add_argument(
        "--seed", type=whole(0, MOST), default=1, help="random seed (default: %(default)s)"
    )
    fuzzing.set_defaults(run=_fuzz)

    quiet = commands.add_parser(
        "quiet",
        help="fly fleets to all layouts; print what nodes warn of although nothing is wrong",
    )
    quiet.add_argument(
        "--runs",
        type=whole(1, MOST),
        default=10,
        metavar="N",
        help="number of seeds (default %(default)s)",
    )
    quiet.set_defaults(run=_quiet)

    options = parser.parse_args(argv)
    run: Callable[[argparse.Namespace], int] = options.run
    return run(options)


def _attack(options: argparse.Namespace) -> int:
    unknown = set(options.attacks).difference(ATTACKS)
    if unknown:
        raise MeshError(f"unknown attack {min(unknown)!r}: use one of {', '.join(ATTACKS)}")
    logging.disable(logging.WARNING)  # an attacked mesh logs a lot
    print(*TABLE_HEAD, sep="\n", flush=True)
    for name in options.attacks or ATTACKS:
        row = damage_row(name, options.runs)
        print(row, flush=True)
        if options.page is not None:
            options.page.write_text(with_row(options.page.read_text("utf-8"), row), "utf-8")
    return 0


def _quiet(options: argparse.Namespace) -> int:
    """Returns 1 if a node warned of anything."""
    all_runs, noisy = list(runs(options.runs)), 0
    progress = Progress(len(all_runs))
    for run in all_runs:
        lines = warnings_of(run)
        progress.count(failed=False)
        if lines:
            noisy += 1
            print(run, *lines, sep="\n  ", flush=True)
    progress.close()
    print(f"{len(all_runs)} runs, {noisy} with a warning")
    return int(noisy > 0)


def _fuzz(options: argparse.Namespace) -> int:
    logging.disable(logging.WARNING)

    def progress(done: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{done} of {options.packets} packets", end="\r", file=sys.stderr, flush=True)

    for case, key in (("without a key", None), ("with a key", KEY)):
        result = fuzz(options.packets, options.seed, key, progress)
        print(
            f"{case}: {options.packets} packets, no exception; {result.moved} drones moved, "
            f"{result.connected} of {NODES - 1} routers connected a minute later",
            flush=True,
        )
    for case, keys in (("without a key", None), ("with a key", keys_of)):
        half, end = crowd(options.packets, options.seed, keys, progress)
        print(
            f"{case}: {options.packets} packets of 254 invented nodes; the tables of {NODES} nodes "
            f"hold {end.entries} entries, {half.entries} after half of the packets, the largest "
            f"table {end.largest}",
            flush=True,
        )
    return 0
