"""Recorded motion: the files of BonnMotion and of ns-2, CSV, and the record of a gateway."""

from __future__ import annotations

import csv
import gzip
import zlib
from pathlib import Path
from typing import Iterable, Tuple

from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.bonnmotion import read_bonnmotion
from drone_mesh.mobility.gateway_record import FIRST_BYTE, answers, places
from drone_mesh.mobility.knots import Knots, number_in
from drone_mesh.mobility.ns2_movement import is_ns2, read_ns2

TraceRow = Tuple[float, int, float, float, float]  # t (s), drone, x, y, z (m)

CSV_HEADER = ["t", "id", "x", "y", "z"]


def read_trace(path: Path) -> Knots:
    """The times and places in a file, also in a compressed one (.gz). Its content shows its kind:

    * CSV with the header t,id,x,y,z (seconds and metres);
    * ns-2 movement: `$node_(0) set X_ 1.0`, `$ns_ at 2.0 "$node_(0) setdest 3.0 4.0 1.5"`;
    * BonnMotion: a line per drone, `t x y` again and again, or after a line `#3D` `t x y z`;
    * the record of a gateway: straight lines between the places that its nodes reported.

    The k-th line of BonnMotion and node k of ns-2 are drone k. Raises ConfigurationError.
    """
    try:
        if path.suffix == ".gz":
            text = gzip.decompress(path.read_bytes()).decode("utf-8")
        else:
            text = path.read_text(encoding="utf-8")
    except (EOFError, zlib.error) as error:
        raise ConfigurationError(f"trace {path}: damaged or cut off; compress it again") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"trace {path}: {error}") from error
    lines = text.splitlines()
    try:
        if lines and [name.strip() for name in lines[0].split(",")] == CSV_HEADER:
            knots = _csv(lines)
        elif is_ns2(lines):
            knots = read_ns2(lines)
        elif lines and lines[0].startswith(FIRST_BYTE):
            knots = _recorded(lines)
        else:
            knots = read_bonnmotion(lines)
    except ValueError as error:
        raise ConfigurationError(f"trace {path}: {error}") from error
    if not knots:
        raise ConfigurationError(f"trace {path}: no drone in it")
    return knots


def write_csv(path: Path, rows: Iterable[TraceRow]) -> None:
    """Write a trace that `read_trace` reads. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(CSV_HEADER)
        for t, node, *place in rows:
            writer.writerow([f"{t:.3f}", node, *(f"{value:.3f}" for value in place)])


def _csv(lines: Iterable[str]) -> Knots:
    found: Knots = {}
    for number, row in enumerate(csv.reader(lines), start=1):
        if number == 1 or not row:
            continue
        try:
            t, node, x, y, z = row
            knot = (number_in(t), number_in(x), number_in(y), number_in(z))
            found.setdefault(int(node), []).append(knot)
        except ValueError as error:
            raise ValueError(f"line {number}: expected t,id,x,y,z as numbers") from error
    return {node: sorted(knots) for node, knots in sorted(found.items())}


def _recorded(lines: Iterable[str]) -> Knots:
    found: Knots = {}
    for t, answer in answers(lines):
        for node, place in places(answer):
            knots = found.setdefault(node, [])
            if not knots or knots[-1][1:] != place:
                knots.append((t, *place))
    return found
