"""The state of the mesh as text for a terminal or pipe."""

from __future__ import annotations

from typing import Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition, Trouble, condition_of, find_trouble, summarise
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known
from drone_mesh.view.palette import ansi

_BOLD, _PLAIN = "\x1b[1m", "\x1b[0m"
_LONGEST_ROUTE = 6  # ids shown of a route before its middle is left out
_HEADINGS = (
    "node", "kind", "power", "connected", "gateway", "hops", "neighbours", "known", "sent",
    "position (x, y, z)", "route", "remark",
)  # fmt: skip
_CHANNEL_HEADINGS = ("airtime", "tries", "queue", "given up")  # of a shared channel


def mesh_table(mesh: MeshStatus, colours: bool) -> str:
    """A summary line and a table, one row per node, without a final newline. `colours`: ANSI."""
    troubles = {trouble.node: trouble for trouble in find_trouble(mesh.nodes)}
    summary = summarise(mesh.nodes, list(troubles.values()))
    speed = "paused" if mesh.paused else f"speed {mesh.achieved_real_time_factor:.2g}x"
    heading = f"t = {mesh.stamp_s:.1f} s, {speed}: {summary.text}{_names(mesh)}"
    headings: tuple[str, ...] = _HEADINGS
    rows = [_row(node, troubles.get(node.id)) for node in mesh.nodes]
    if any(node.tries for node in mesh.nodes):
        headings = _HEADINGS[:-1] + _CHANNEL_HEADINGS + _HEADINGS[-1:]
        rows = [row[:-1] + _channel(node) + row[-1:] for row, node in zip(rows, mesh.nodes)]
    widths = [max(len(row[i]) for row in [headings, *rows]) for i in range(len(headings))]
    lines = [_line(headings, widths), *(_line(row, widths) for row in rows)]
    if colours:
        heading = ansi(heading, summary.severity)
        lines[0] = f"{_BOLD}{lines[0]}{_PLAIN}"
        for number, node in enumerate(mesh.nodes, start=1):
            condition = condition_of(node)
            connected_badly = condition is Condition.CONNECTED and node.id in troubles
            what = troubles[node.id].severity if connected_badly else condition
            lines[number] = ansi(lines[number], what)
    return "\n".join([heading, *mesh.layouts, *lines])


def _row(node: NodeStatus, trouble: Trouble | None) -> tuple[str, ...]:
    return (
        str(node.id),
        Role(node.role).name.lower(),
        "on" if node.on else "off",
        "yes" if node.connected else "no",
        _number(node.gateway),
        _number(node.hops),
        str(len(node.neighbours)),
        str(node.known_nodes),
        str(node.total_messages),
        _position(node),
        _route(node.route),
        "; ".join(filter(None, (trouble.text if trouble else "", node.repair, node.mission))),
    )


def _names(mesh: MeshStatus) -> str:
    """The techniques in use, as text; old recordings do not contain them."""
    techniques = {"routing": mesh.routing, "repair": mesh.repair_strategy}
    return "".join(f"; {what} {name}" for what, name in techniques.items() if name)


def _channel(node: NodeStatus) -> tuple[str, ...]:
    return (
        f"{100 * node.airtime:.1f} %",
        f"{node.tries:.2f}",
        str(node.queue),
        str(node.given_up),
    )


def _line(cells: Sequence[str], widths: list[int]) -> str:
    return "  ".join(cell.ljust(width) for cell, width in zip(cells, widths)).rstrip()


def _number(value: int) -> str:
    return "-" if value == NO_ROUTE else str(value)


def _position(node: NodeStatus) -> str:
    if not position_is_known(node):
        return "-"
    position = ", ".join(f"{metres:.1f}" for metres in node.position)
    if not len(node.path):
        return position
    goal = ", ".join(f"{metres:.1f}" for metres in node.path[-3:])
    return f"{position} -> {goal}"


def _route(route: Sequence[int]) -> str:
    ids = [str(node) for node in route]
    if len(ids) > _LONGEST_ROUTE:
        ids = [*ids[:3], "...", *ids[-2:]]
    return " > ".join(ids) or "-"
