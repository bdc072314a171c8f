"""ns-2 movement files: start places, and orders to fly somewhere at some speed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Iterable, Iterator

from drone_mesh.mobility.knots import Knots, number_in
from drone_mesh.mobility.settings import Knot

_START = re.compile(r"\$node_\((\d+)\)\s+set\s+([XYZ])_\s+([^\s;]+)\s*;?")
_SETDEST = re.compile(
    r'\$ns_\s+at\s+(\S+)\s+"\$node_\((\d+)\)\s+setdest\s+(\S+)\s+(\S+)\s+([^\s"]+)\s*"\s*;?'
)
_NO_MOVEMENT = re.compile(r'(#.*|\$god_\s.*|\$ns_\s+at\s+\S+\s+"\$god_\s.*)?')  # god_: hop counts


def is_ns2(lines: Iterable[str]) -> bool:
    """Whether these are the lines of such a file; no other trace has a line that begins so."""
    return any(line.lstrip().startswith("$") for line in lines)


def read_ns2(lines: Iterable[str]) -> Knots:
    """Node k is drone k. Raises ValueError, which names the line or the node."""
    nodes: dict[int, _Ns2Node] = {}
    for number, line in enumerate(map(str.strip, lines), start=1):
        start, order = _START.fullmatch(line), _SETDEST.fullmatch(line)
        if start:
            node, axis, value = start.groups()
            place = nodes.setdefault(int(node), _Ns2Node()).start
            place[axis] = number_in(value, number, f"{axis}_")
        elif order:
            at, node, *words = order.groups()
            at_s, x, y, speed_m_s = (number_in(word, number) for word in (at, *words))
            if at_s < 0 or speed_m_s < 0:
                raise ValueError(f"line {number}: time {at} and speed {words[2]} must be 0 or more")
            nodes.setdefault(int(node), _Ns2Node()).orders.append((at_s, x, y, speed_m_s))
        elif not _NO_MOVEMENT.fullmatch(line):
            raise ValueError(
                f"line {number}: expected $node_(K) set X_ NUMBER (or Y_, Z_), "
                f'$ns_ at TIME "$node_(K) setdest X Y SPEED", or a comment, not {line[:60]!r}'
            )
    for node_id, found in nodes.items():
        if not found.start:
            raise ValueError(
                f"node {node_id} has no start: expected $node_({node_id}) set X_ NUMBER"
            )
    return {node_id: list(nodes[node_id].knots()) for node_id in sorted(nodes)}


@dataclass
class _Ns2Node:
    """One node of an ns-2 movement file: a new destination replaces the one before."""

    start: dict[str, float] = field(default_factory=dict)  # by axis; 0 where a file has none
    # When, where to (x, y), and how fast; at speed 0 it stays.
    orders: list[tuple[float, float, float, float]] = field(default_factory=list)

    def knots(self) -> Iterator[Knot]:
        x, y, z = (self.start.get(axis, 0.0) for axis in "XYZ")
        yield 0.0, x, y, z
        orders = sorted(self.orders, key=lambda order: order[0])
        ends_s = [at_s for at_s, *_rest in orders[1:]] + [math.inf]
        for (at_s, to_x, to_y, speed_m_s), replaced_s in zip(orders, ends_s):
            yield at_s, x, y, z
            way_m = math.dist((x, y), (to_x, to_y))
            if not way_m or not speed_m_s:
                continue
            arrives_s = at_s + way_m / speed_m_s
            share = min(1.0, (replaced_s - at_s) / (arrives_s - at_s))
            x, y = x + (to_x - x) * share, y + (to_y - y) * share
            yield min(arrives_s, replaced_s), x, y, z
