"""One bar per node that was without a gateway: its phases and their durations."""

from __future__ import annotations

import math

from drone_mesh.report.drawing import figure_with_rows, svg_of
from drone_mesh.report.story import RunStory
from drone_mesh.state.outages import Outage
from drone_mesh.view.palette import LIGHT

SHORTEST_S = 0.05  # a shorter phase would be invisible
PHASES = (  # of an outage: until when, name, colour
    ("emergency_s", "waits for a gateway", LIGHT.disconnected),
    ("decided_s", "negotiates", LIGHT.gateway),
    ("landed_s", "flies", LIGHT.flying),
    ("connected_s", "reconnects", LIGHT.connected),
)
OPACITY = 0.6
ROW_IN = 0.32
MOST_ROWS_IN = 12.0  # the rows of a crowd share this height: the page stays readable
NAMED_ROW_IN = 0.16  # in lower rows the names of the nodes would overlap


def outages_figure(story: RunStory) -> str:
    """The bars over simulated time."""
    nodes = sorted({outage.node for outage in story.outages})
    row_in = min(ROW_IN, MOST_ROWS_IN / len(nodes))
    step = math.ceil(NAMED_ROW_IN / row_in)  # 1: every row has its name
    figure, (axes,) = figure_with_rows(1.2 + row_in * len(nodes))
    end_s = story.samples[-1].stamp_s
    named: set[str] = set()
    for outage in story.outages:
        row = nodes.index(outage.node)
        for start_s, stop_s, name, colour in phases_of(outage, end_s):
            label = name if name not in named else None
            named.add(name)
            axes.barh(
                row, stop_s - start_s, left=start_s, height=0.62, color=colour, alpha=OPACITY,
                label=label,
            )  # fmt: skip
        if outage.connected_s is None and step == 1:
            axes.text(end_s, row, " still disconnected", va="center", color=LIGHT.disconnected)
    axes.set_yticks(range(0, len(nodes), step), [f"node {node}" for node in nodes[::step]])
    axes.set_ylim(len(nodes) - 0.4, -0.6)  # the lowest id on top, and the same room in a crowd
    axes.set_xlabel("simulated time, s")
    figure.legend(loc="outside upper left", ncols=4, frameon=False, labelcolor=LIGHT.ink)
    return svg_of(figure)


def phases_of(outage: Outage, end_s: float) -> list[tuple[float, float, str, str]]:
    """(start, stop, name, colour) of each phase; `end_s` is the end of the recording."""
    phases = []
    start_s = outage.lost_s
    for attribute, name, colour in PHASES:
        stop_s = getattr(outage, attribute)
        if stop_s is None and attribute != "connected_s":
            continue
        # A node that did not fly has no landing before its reconnection, and a node that joined a
        # neighbour's negotiation has no emergency of its own: both count as waiting.
        if attribute == "connected_s" and outage.landed_s is None:
            name, colour = PHASES[0][1:] if outage.decided_s is None else PHASES[2][1:]
        elif attribute == "decided_s" and outage.emergency_s is None:
            name, colour = PHASES[0][1:]
        stop_s = end_s if stop_s is None else min(stop_s, outage.connected_s or end_s)
        if stop_s - start_s > SHORTEST_S:
            phases.append((start_s, stop_s, name, colour))
        start_s = max(start_s, stop_s)
    return phases
