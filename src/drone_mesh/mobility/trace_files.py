"""Recorded motion: the files of BonnMotion and of ns-2, CSV, and the record of a gateway."""

from __future__ import annotations

import csv
import gzip
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, Tuple

from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.gateway_record import FIRST_BYTE, answers, places
from drone_mesh.mobility.settings import Knot

Knots = Dict[int, List[Knot]]  # by drone, in order of time

TraceRow = Tuple[float, int, float, float, float]  # t (s), drone, x, y, z (m)

CSV_HEADER = ["t", "id", "x", "y", "z"]
_START = re.compile(r"\$node_\((\d+)\)\s+set\s+([XYZ])_\s+(\S+)")
_SETDEST = re.compile(
    r'\$ns_\s+at\s+(\S+)\s+"\$node_\((\d+)\)\s+setdest\s+(\S+)\s+(\S+)\s+([^\s"]+)\s*"'
)


def read_trace(path: Path) -> Knots:
    """The times and places in a file, also in a compressed one (.gz). Its content shows its kind:

    * CSV with the header t,id,x,y,z (seconds and metres);
    * ns-2 movement: `$node_(0) set X_ 1.0`, `$ns_ at 2.0 "$node_(0) setdest 3.0 4.0 1.5"`;
    * BonnMotion: a line per drone, `t x y` again and again, or `t x y z`;
    * the record of a gateway: straight lines between the places that its nodes reported.

    The k-th line of BonnMotion and node k of ns-2 are drone k. Raises ConfigurationError.
    """
    try:
        if path.suffix == ".gz":
            text = gzip.decompress(path.read_bytes()).decode("utf-8")
        else:
            text = path.read_text(encoding="utf-8")
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"trace {path}: {error}") from error
    lines = text.splitlines()
    try:
        if lines and [name.strip() for name in lines[0].split(",")] == CSV_HEADER:
            knots = _csv(lines)
        elif any(_START.match(line.strip()) for line in lines):
            knots = _ns2(lines)
        elif lines and lines[0].startswith(FIRST_BYTE):
            knots = _recorded(lines)
        else:
            knots = _bonnmotion(lines)
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
            knot = (_number(t), _number(x), _number(y), _number(z))
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


def _bonnmotion(lines: Iterable[str]) -> Knots:
    drones = [list(_numbers(number, line)) for number, line in enumerate(lines, 1) if line.strip()]
    for columns in (3, 4):
        if all(_is_track(numbers, columns) for numbers in drones):
            return {
                node: [_knot(numbers[i : i + columns]) for i in range(0, len(numbers), columns)]
                for node, numbers in enumerate(drones)
            }
    raise ValueError("expected t,id,x,y,z lines, ns-2 movements, or 't x y' with rising t per line")


def _numbers(number: int, line: str) -> Iterator[float]:
    try:
        yield from (_number(word) for word in line.split())
    except ValueError as error:
        raise ValueError(f"line {number}: expected numbers, t x y again and again") from error


def _is_track(numbers: list[float], columns: int) -> bool:
    times = numbers[::columns]
    return len(numbers) % columns == 0 and all(a <= b for a, b in zip(times, times[1:]))


def _knot(numbers: list[float]) -> Knot:
    t, x, y, *z = numbers
    return t, x, y, z[0] if z else 0.0


@dataclass
class _Ns2Node:
    """One node of an ns-2 movement file: a new destination replaces the one before."""

    start: dict[str, float] = field(default_factory=lambda: {"X": 0.0, "Y": 0.0, "Z": 0.0})
    # When, where to (x, y), and how fast; at speed 0 it stays.
    orders: list[tuple[float, float, float, float]] = field(default_factory=list)

    def knots(self) -> Iterator[Knot]:
        x, y, z = (self.start[axis] for axis in "XYZ")
        yield 0.0, x, y, z
        orders = sorted(self.orders)
        ends_s = [at_s for at_s, *_rest in orders[1:]] + [math.inf]
        for (at_s, to_x, to_y, speed_m_s), replaced_s in zip(orders, ends_s):
            yield at_s, x, y, z
            way_m = math.dist((x, y), (to_x, to_y))
            if not way_m or speed_m_s <= 0:
                continue
            arrives_s = at_s + way_m / speed_m_s
            share = min(1.0, (replaced_s - at_s) / (arrives_s - at_s))
            x, y = x + (to_x - x) * share, y + (to_y - y) * share
            yield min(arrives_s, replaced_s), x, y, z


def _ns2(lines: Iterable[str]) -> Knots:
    nodes: dict[int, _Ns2Node] = {}
    for number, line in enumerate(lines, start=1):
        start, order = _START.match(line.strip()), _SETDEST.match(line.strip())
        try:
            if start:
                node, axis, value = start.groups()
                nodes.setdefault(int(node), _Ns2Node()).start[axis] = _number(value)
            elif order:
                at_s, node, x, y, speed = order.groups()
                flight = (_number(at_s), _number(x), _number(y), _number(speed))
                nodes.setdefault(int(node), _Ns2Node()).orders.append(flight)
        except ValueError as error:
            raise ValueError(f"line {number}: expected numbers") from error
    return {node: list(nodes[node].knots()) for node in sorted(nodes)}


def _number(text: str) -> float:
    """Raises ValueError, also for nan and inf."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is not finite")
    return value
