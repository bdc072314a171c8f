"""ns-2 movement files: start places, and orders to fly somewhere at some speed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Iterable, Iterator, Sequence

from drone_mesh.mobility.knots import Knots, number_in
from drone_mesh.mobility.settings import Knot

_START = re.compile(r"\$node_\((\d+)\)\s+set\s+([XYZ])_\s+(\S+)")
_SETDEST = re.compile(
    r'\$ns_\s+at\s+(\S+)\s+"\$node_\((\d+)\)\s+setdest\s+(\S+)\s+(\S+)\s+([^\s"]+)\s*"'
)


def is_ns2(lines: Sequence[str]) -> bool:
    """Whether these are the lines of such a file."""
    return any(_START.match(line.strip()) for line in lines)


def read_ns2(lines: Iterable[str]) -> Knots:
    """Node k is drone k. Raises ValueError, which names the line."""
    nodes: dict[int, _Ns2Node] = {}
    for number, line in enumerate(lines, start=1):
        start, order = _START.match(line.strip()), _SETDEST.match(line.strip())
        try:
            if start:
                node, axis, value = start.groups()
                nodes.setdefault(int(node), _Ns2Node()).start[axis] = number_in(value)
            elif order:
                at_s, node, x, y, speed = order.groups()
                flight = (number_in(at_s), number_in(x), number_in(y), number_in(speed))
                nodes.setdefault(int(node), _Ns2Node()).orders.append(flight)
        except ValueError as error:
            raise ValueError(f"line {number}: expected numbers") from error
    return {node: list(nodes[node].knots()) for node in sorted(nodes)}


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
