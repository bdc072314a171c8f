"""Recorded motion: the files of BonnMotion and of ns-2, CSV, and the record of a gateway."""

from __future__ import annotations

import csv
import gzip
import zlib
from pathlib import Path
from typing import Iterable, Iterator, Sequence, Tuple

from drone_mesh.arguments import MOST, is_up_to
from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.bonnmotion import read_bonnmotion
from drone_mesh.mobility.gateway_record import FIRST_BYTE, answers, places
from drone_mesh.mobility.knots import Knots, follows, number_in
from drone_mesh.mobility.ns2_movement import is_ns2, read_ns2
from drone_mesh.mobility.settings import Knot

TraceRow = Tuple[float, int, float, float, float]  # t (s), drone, x, y, z (m)

MOST_BYTES = 50_000_000  # unpacked: 250 drones that say where they are for an hour
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
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise ConfigurationError(f"trace {path}: larger than {MOST_BYTES} bytes")
        text = content.decode("utf-8-sig")
    except (EOFError, zlib.error) as error:
        raise ConfigurationError(f"trace {path}: damaged or cut off; compress it again") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"trace {path}: not a text file in UTF-8") from error
    except OSError as error:
        raise ConfigurationError(f"trace {path}: {error}") from error
    lines = text.splitlines()
    try:
        if [name.strip() for row in _rows(lines[:1]) for name in row] == CSV_HEADER:
            knots = _csv(lines)
        elif is_ns2(lines):
            knots = read_ns2(lines)
        elif lines and lines[0].startswith(FIRST_BYTE):
            knots = _recorded(lines)
        elif lines and _is_another_table(lines[0]):
            header = ",".join(CSV_HEADER)
            raise ValueError(f"line 1: expected the header {header}, not {lines[0][:60]!r}")
        else:
            knots = read_bonnmotion(lines)
    except (ValueError, csv.Error) as error:
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


def _is_another_table(line: str) -> bool:
    """Whether a file that begins so is CSV with another header or separator, or with none."""
    words = line.split()
    return "," in line or ";" in line or bool(words) and words[0].isidentifier()


def _csv(lines: Iterable[str]) -> Knots:
    """Rows may come in any order. Raises ValueError, which names the line."""
    found: dict[int, list[tuple[Knot, int]]] = {}  # each with its line
    for number, row in enumerate(_rows(lines), start=1):
        if number == 1 or not row:
            continue
        node, knot = _row(number, row)
        found.setdefault(node, []).append((knot, number))
    for node, knots in found.items():
        knots.sort()
        for (before, _line), (knot, number) in zip(knots, knots[1:]):
            if not follows(knot, before):
                raise ValueError(f"line {number}: drone {node} is at two places at {knot[0]:g} s")
    return {node: [knot for knot, _line in found[node]] for node in sorted(found)}


def _rows(lines: Iterable[str]) -> Iterator[list[str]]:
    return csv.reader(lines, skipinitialspace=True)


def _row(number: int, row: Sequence[str]) -> tuple[int, Knot]:
    if len(row) != len(CSV_HEADER):
        raise ValueError(f"line {number}: expected {','.join(CSV_HEADER)}, not {len(row)} values")
    if not is_up_to(row[1].strip(), MOST):
        raise ValueError(f"line {number}: id {row[1].strip()} must be a whole number, 0 or more")
    t, x, y, z = (
        number_in(text, number, name) for name, text in zip(CSV_HEADER, row) if name != "id"
    )
    return int(row[1]), (t, x, y, z)


def _recorded(lines: Iterable[str]) -> Knots:
    found: Knots = {}
    for t, answer in answers(lines):
        for node, place in places(answer):
            knots = found.setdefault(node, [])
            if not knots or (t > knots[-1][0] and knots[-1][1:] != place):
                knots.append((t, *place))
    return found
