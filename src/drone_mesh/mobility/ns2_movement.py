"""ns-2 movement files: start places, and orders to fly somewhere at some speed.

Read as ns-3's Ns2MobilityHelper does: in any order of lines, and a node without a start begins
at 0, 0. What that one leaves out, as it cannot read it, is refused here.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Iterable, Iterator, Mapping, NamedTuple

from drone_mesh.arguments import MOST
from drone_mesh.mobility.knots import Knots, number_in
from drone_mesh.mobility.settings import Knot

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
