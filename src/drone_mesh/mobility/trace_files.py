"""Recorded motion: the files of BonnMotion and of ns-2, CSV, and the record of a gateway."""

from __future__ import annotations

import csv
import gzip
import math
import re
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

from drone_mesh.arguments import MOST, finite, is_up_to
from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.gateway_record import FIRST_BYTE, answers, places
from drone_mesh.mobility.settings import Knot

Knots = Dict[int, List[Knot]]  # by drone, in order of time


def number_in(text: str, line: int, name: str = "") -> float:
    """The number called `name` in this line. Raises ValueError, also for one above 1e9."""
    try:
        return finite(text)
    except ValueError:
        given = f"{name} {text}".strip()
        raise ValueError(f"line {line}: expected numbers, not {given[:60]}") from None


def follows(knot: Knot, before: Knot) -> bool:
    """Whether this place can follow: its time is later, or equal at an equal place."""
    return knot[0] > before[0] or knot == before


_COLUMNS = {"#2D": 3, "#3D": 4}  # BonnMotion itself writes #3D only

_Line = Tuple[int, List[float]]  # its number in the file, and the numbers in it


def read_bonnmotion(lines: Iterable[str]) -> Knots:
    """The k-th line that is no comment is drone k. Raises ValueError, which names the line.

    Without a line #2D or #3D the times tell which it is, as they rise in each line.
    """
    drones: list[_Line] = []
    readings = sorted(_COLUMNS.values())
    for number, line in enumerate(lines, start=1):
        if line.strip() in _COLUMNS:
            readings = [_COLUMNS[line.strip()]]
        elif line.strip() and not line.startswith("#"):
            drones.append((number, [number_in(word, number) for word in line.split()]))
    if not drones:
        return {}
    for number, numbers in drones:
        if not any(_is_track(numbers, columns) for columns in readings):
            wanted = " or ".join("t x y z"[: 2 * columns - 1] for columns in readings)
            raise ValueError(f"line {number}: expected {wanted} again and again, with rising t")
    fit = [c for c in readings if all(_is_track(numbers, c) for _number, numbers in drones)]
    if len(fit) != 1:
        both = "fits both t x y and t x y z" if fit else "has lines of t x y and lines of t x y z"
        raise ValueError(f"{both}: say which it is in a first line #2D or #3D")
    return {node: list(_knots(numbers, fit[0])) for node, (_number, numbers) in enumerate(drones)}


def _is_track(numbers: list[float], columns: int) -> bool:
    if len(numbers) % columns:
        return False
    knots = list(_knots(numbers, columns))
    return all(follows(b, a) for a, b in zip(knots, knots[1:]))


def _knots(numbers: list[float], columns: int) -> Iterator[Knot]:
    for first in range(0, len(numbers), columns):
        t, x, y, *z = numbers[first : first + columns]
        yield t, x, y, z[0] if z else 0.0


_START = re.compile(r"\$node_\(([0-9]{1,9})\)\s+set\s+([XYZ])_\s+([^\s;]+)\s*;?")
_ORDER = re.compile(
    r'\$ns_\s+at\s+(\S+)\s+"\s*\$node_\(([0-9]{1,9})\)\s+'
    r'(?:setdest\s+(\S+)\s+(\S+)\s+([^\s"]+)|set\s+([XYZ])_\s+([^\s"]+))\s*"\s*;?'
)
# god_ counts hops; a variable moves nobody.
_NO_MOVEMENT = re.compile(r'(\$god_\s.*|\$ns_\s+at\s+\S+\s+"\$god_\s.*|set\s.*)?')


class _Statement(NamedTuple):
    """Fly somewhere from this time on; at speed 0 it stays, at an infinite one it is there."""

    at_s: float
    to: Mapping[str, float]  # by axis; on the others it stays
    speed_m_s: float


def is_ns2(lines: Iterable[str]) -> bool:
    """Whether these are the lines of such a file; no other trace has a line that begins so."""
    return any(line.lstrip().startswith("$") for line in lines)


def read_ns2(lines: Iterable[str]) -> Knots:
    """Node k is drone k. Raises ValueError, which names the line."""
    nodes: dict[int, _Ns2Node] = {}
    for number, line in enumerate(lines, start=1):
        statement = line.partition("#")[0].strip()
        start, order = _START.fullmatch(statement), _ORDER.fullmatch(statement)
        if start:
            node, axis, value = start.groups()
            place = nodes.setdefault(int(node), _Ns2Node()).start
            place[axis] = number_in(value, number, f"{axis}_")
        elif order:
            at, node, to_x, to_y, speed, axis, value = order.groups()
            to = {axis: value} if axis else {"X": to_x, "Y": to_y}
            goal = {axis: number_in(word, number) for axis, word in to.items()}
            speed_m_s = math.inf if axis else number_in(speed, number)
            at_s = number_in(at, number)
            if at_s < 0 or speed_m_s < 0:
                raise ValueError(f"line {number}: time {at} and speed {speed} must be 0 or more")
            nodes.setdefault(int(node), _Ns2Node()).orders.append(_Statement(at_s, goal, speed_m_s))
        elif not _NO_MOVEMENT.fullmatch(statement):
            raise ValueError(
                f"line {number}: expected $node_(K) set X_ NUMBER (or Y_, Z_), "
                f'$ns_ at TIME "$node_(K) setdest X Y SPEED" (or set X_ NUMBER), or a comment, '
                f"not {line.strip()[:60]!r}"
            )
    return {node_id: list(nodes[node_id].knots()) for node_id in sorted(nodes)}


@dataclass
class _Ns2Node:
    """One node of an ns-2 movement file: a new order replaces the one before."""

    start: dict[str, float] = field(default_factory=dict)  # by axis; 0 where a file has none
    orders: list[_Statement] = field(default_factory=list)

    def knots(self) -> Iterator[Knot]:
        place = {axis: self.start.get(axis, 0.0) for axis in "XYZ"}

        def knot(at_s: float) -> Knot:
            return at_s, place["X"], place["Y"], place["Z"]

        yield knot(0.0)
        orders = sorted(self.orders, key=lambda order: order.at_s)
        ends_s = [order.at_s for order in orders[1:]] + [math.inf]
        for (at_s, to, speed_m_s), replaced_s in zip(orders, ends_s):
            yield knot(at_s)
            goal = {**place, **to}
            way_m = math.dist(tuple(place.values()), tuple(goal.values()))
            if not way_m or way_m > speed_m_s * MOST:  # it stays, or is as slow as if it did
                continue
            needs_s, has_s = way_m / speed_m_s, replaced_s - at_s
            share = 1.0 if needs_s <= has_s else has_s / needs_s
            for axis, end in to.items():
                place[axis] += (end - place[axis]) * share
            yield knot(min(at_s + needs_s, replaced_s))


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
