"""Charts of a run: connected share, hops, outages, and messages per node."""

from __future__ import annotations

import math
from typing import Iterable, Iterator, Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, PercentFormatter

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.roles import Role
from drone_mesh.lab.run_report.drawing import figure_with, svg_of
from drone_mesh.lab.run_report.story import RunStory
from drone_mesh.state.model import EventRecord
from drone_mesh.state.outages import Outage
from drone_mesh.view.palette import LIGHT

MOST_NAMED = 12  # labelled events of one kind; more would overlap
MOST_IDS = 4  # of nodes in one label
LABEL_POINTS = (8, 18)  # above their marks; labels close to each other alternate
MARKS_AT = 1.04  # of the share's axis: above a line at 100 %
CLOSE_SHARE = 0.07  # of the run: labels closer than this would overlap
MOST_BARS_NAMED = 40  # nodes whose ids all fit below their bars
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


def timeline_figure(story: RunStory) -> str:
    """The connected share and the hops over time, with marks for events."""
    figure, (share, hops) = figure_with(4.2, rows=2, heights=(2, 1))
    times = [sample.stamp_s for sample in story.samples]
    connected = with_gaps(sample.connected_share for sample in story.samples)
    share.fill_between(times, connected, color=LIGHT.connected, alpha=0.15, lw=0)
    share.plot(times, connected, color=LIGHT.connected, lw=1.5)
    share.set_ylim(0, 1.08)
    share.set_ylabel("routers connected")
    share.yaxis.set_major_formatter(PercentFormatter(xmax=1))
    _mark_events(share, story)
    most = with_gaps(sample.most_hops for sample in story.samples)
    mean = with_gaps(sample.mean_hops for sample in story.samples)
    hops.plot(times, most, color=LIGHT.accent, label="maximum")
    hops.plot(times, mean, color=LIGHT.gateway, label="mean")
    hops.set_ylabel("hops")
    hops.set_ylim(bottom=0)
    hops.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    hops.legend(loc="lower right", frameon=False, ncols=2, labelcolor=LIGHT.ink)
    hops.set_xlabel("simulated time, s")
    for axes in (share, hops):
        axes.set_xlim(times[0], max(times[-1], times[0] + 1))
    return svg_of(figure)


def with_gaps(values: Iterable[float | None]) -> list[float]:
    """The values of a line, with NaN in place of None, where matplotlib leaves a gap."""
    return [math.nan if value is None else value for value in values]


def messages_figure(story: RunStory) -> str:
    ids = sorted(story.messages_of)
    figure, (axes,) = figure_with(2.4)
    gateways = {node.id for node in story.after.nodes if node.role == Role.GATEWAY}
    axes.bar(
        [str(node) for node in ids] if len(ids) <= MOST_BARS_NAMED else ids,
        [story.messages_of[node] for node in ids],
        color=[LIGHT.gateway if node in gateways else LIGHT.connected for node in ids],
    )
    axes.set_xlabel("node")
    axes.set_ylabel("messages sent")
    axes.margins(x=0.01)
    return svg_of(figure)


def outages_figure(story: RunStory) -> str:
    """The bars over simulated time."""
    nodes = sorted({outage.node for outage in story.outages})
    row_in = min(ROW_IN, MOST_ROWS_IN / len(nodes))
    step = math.ceil(NAMED_ROW_IN / row_in)  # 1: every row has its name
    figure, (axes,) = figure_with(1.2 + row_in * len(nodes))
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


def _mark_events(axes: Axes, story: RunStory) -> None:
    marks: Sequence[tuple[MeshEventKind, str, str, str]] = (
        (MeshEventKind.POWER_OFF, LIGHT.off, "v", "off"),
        (MeshEventKind.POWER_ON, LIGHT.off, "^", "on"),
        (MeshEventKind.FLIGHT_DECIDED, LIGHT.flying, "D", "flies"),
    )
    close_s = CLOSE_SHARE * (story.samples[-1].stamp_s - story.samples[0].stamp_s)
    labels: list[tuple[float, str, str]] = []
    for kind, colour, shape, word in marks:
        found = [event for event in story.events if event.kind == kind.value]
        for event in found:
            axes.plot([event.stamp_s], [MARKS_AT], marker=shape, color=colour, ms=6, clip_on=False)
        if len(found) <= MOST_NAMED:
            labels += [(at_s, text, colour) for at_s, text in grouped(found, word, close_s)]
    height, before_s = LABEL_POINTS[0], -math.inf
    for at_s, text, colour in sorted(labels):
        close = at_s - before_s < close_s
        height = LABEL_POINTS[close and height == LABEL_POINTS[0]]
        before_s = at_s
        axes.annotate(
            text, (at_s, MARKS_AT), (4, height), size=8, color=colour,
            textcoords="offset points", annotation_clip=False,
        )  # fmt: skip


def grouped(
    events: Sequence[EventRecord], word: str, close_s: float
) -> Iterator[tuple[float, str]]:
    """Yield (time, text), oldest first: one label for all events within `close_s` seconds."""
    rest = list(events)
    while rest:
        first_s = rest[0].stamp_s
        group = [event for event in rest if event.stamp_s - first_s < close_s]
        rest = rest[len(group) :]
        ids = list(dict.fromkeys(str(event.node) for event in group))
        more = ", …" if len(ids) > MOST_IDS else ""
        yield first_s, f"{', '.join(ids[:MOST_IDS])}{more} {word}"
