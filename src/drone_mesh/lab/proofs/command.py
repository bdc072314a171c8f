"""The commands of the lab that try to do harm: attack and fuzz."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

from drone_mesh.arguments import MOST, whole
from drone_mesh.errors import MeshError
from drone_mesh.lab.proofs.attacks import ATTACKS
from drone_mesh.lab.proofs.damage import KEY, TABLE_HEAD, damage_row, keys_of, with_row
from drone_mesh.lab.proofs.fuzz import NODES, crowd, fuzz


def add_proofs(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add them to those of the lab."""
    attack = commands.add_parser(
        "attack", help="attack meshes without and with a key, and print the damage as a table"
    )
    attack.add_argument(
        "attacks", nargs="*", metavar="ATTACK", help=f"any of: {', '.join(ATTACKS)} (default: all)"
    )
    attack.add_argument(
        "--runs",
        type=whole(0, MOST),
        default=12,
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


def _attack(options: argparse.Namespace) -> int:
    unknown = set(options.attacks).difference(ATTACKS)
    if unknown:
        raise MeshError(f"unknown attack {min(unknown)!r}: use one of {', '.join(ATTACKS)}")
    if options.runs < 1:
        raise MeshError(f"invalid --runs {options.runs}: must be 1 or more")
    logging.disable(logging.WARNING)  # an attacked mesh logs a lot
    print(*TABLE_HEAD, sep="\n", flush=True)
    for name in options.attacks or ATTACKS:
        row = damage_row(name, options.runs)
        print(row, flush=True)
        if options.page is not None:
            options.page.write_text(with_row(options.page.read_text("utf-8"), row), "utf-8")
    return 0


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
