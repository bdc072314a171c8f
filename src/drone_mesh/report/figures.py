"""The figures of a report, as SVG text (matplotlib)."""

from __future__ import annotations

import io
from typing import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.drone.roles import Role
from drone_mesh.report.story import RunStory
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.outages import Outage

WIDTH_IN = 10.0  # the page scales it
SHORTEST_S = 0.05  # a phase that lasted less cannot be seen
CONNECTED, LOST, OFF, GATEWAY, FLIGHT, LINK = (
    "#0b8a5c", "#d0271d", "#8b95a5", "#6d3fd1", "#d97a00", "#b4bfce",
)  # fmt: skip
PHASES = (  # of an outage: until when, what it is called, colour
    ("emergency_s", "waits for a gateway", "#e9a29d"),
    ("decided_s", "negotiates", "#b29ae4"),
    ("landed_s", "flies", "#efb566"),
    ("connected_s", "joins again", "#8cc9b0"),
)


def timeline_figure(story: RunStory) -> str:
    """The connected share and the hops over time, with what happened."""
    figure, (share, hops) = _figure(4.2, rows=2, heights=(2, 1))
    times = [sample.stamp_s for sample in story.samples]
    share.fill_between(
        times, [100 * s.connected_share for s in story.samples], color=CONNECTED, alpha=0.15, lw=0
    )
    share.plot(times, [100 * s.connected_share for s in story.samples], color=CONNECTED, lw=1.5)
    share.set_ylim(0, 108)
    share.set_ylabel("routers connected")
    share.yaxis.set_major_formatter(PercentFormatter())
    _mark_events(share, story)
    hops.plot(times, [s.most_hops for s in story.samples], color=FLIGHT, lw=1.5, label="most")
    hops.plot(times, [s.mean_hops for s in story.samples], color=GATEWAY, lw=1.5, label="mean")
    hops.set_ylabel("hops")
    hops.set_ylim(bottom=0)
    hops.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    hops.legend(loc="lower right", frameon=False, ncols=2)
    hops.set_xlabel("simulated time, s")
    for axes in (share, hops):
        axes.set_xlim(times[0], max(times[-1], times[0] + 1))
    return _svg(figure)


def outages_figure(story: RunStory) -> str:
    """One bar per node that was lost, in the colours of what it did."""
    nodes = sorted({outage.node for outage in story.outages})
    figure, (axes,) = _figure(1.2 + 0.32 * len(nodes))
    end_s = story.samples[-1].stamp_s
    named: set[str] = set()
    for outage in story.outages:
        for start_s, stop_s, name, colour in phases_of(outage, end_s):
            label = name if name not in named else None
            named.add(name)
            axes.barh(
                nodes.index(outage.node), stop_s - start_s, left=start_s, height=0.62,
                color=colour, label=label,
            )  # fmt: skip
        if outage.connected_s is None:
            axes.text(end_s, nodes.index(outage.node), " still lost", va="center", color=LOST)
    axes.set_yticks(range(len(nodes)), [f"node {node}" for node in nodes])
    axes.invert_yaxis()
    axes.set_xlabel("simulated time, s")
    figure.legend(loc="outside upper left", ncols=4, frameon=False)
    return _svg(figure)


def phases_of(outage: Outage, end_s: float) -> list[tuple[float, float, str, str]]:
    """(start, stop, name, colour) of what a lost node did; `end_s` is the end of the recording."""
    phases = []
    start_s = outage.lost_s
    for attribute, name, colour in PHASES:
        stop_s = getattr(outage, attribute)
        if stop_s is None and attribute != "connected_s":
            continue
        last = attribute == "connected_s"
        # Who never flew did not join again after a flight, and who was asked by another to
        # negotiate had no emergency of its own: they were waiting.
        if last and outage.landed_s is None:
            name, colour = PHASES[0][1:] if outage.decided_s is None else PHASES[2][1:]
        elif attribute == "decided_s" and outage.emergency_s is None:
            name, colour = PHASES[0][1:]
        stop_s = end_s if stop_s is None else min(stop_s, outage.connected_s or end_s)
        if stop_s - start_s > SHORTEST_S:
            phases.append((start_s, stop_s, name, colour))
        start_s = max(start_s, stop_s)
    return phases


def messages_figure(story: RunStory) -> str:
    """Messages that each node sent."""
    ids = sorted(story.messages_of)
    figure, (axes,) = _figure(2.4)
    gateways = {node.id for node in story.after.nodes if node.role == Role.GATEWAY}
    axes.bar(
        [str(node) for node in ids] if len(ids) <= 40 else ids,
        [story.messages_of[node] for node in ids],
        color=[GATEWAY if node in gateways else CONNECTED for node in ids],
    )
    axes.set_xlabel("node")
    axes.set_ylabel("messages sent")
    axes.margins(x=0.01)
    return _svg(figure)


def maps_figure(story: RunStory) -> str:
    """Where everybody was before the first loss and in the end, and the ways they flew."""
    figure = Figure(figsize=(WIDTH_IN, 5.2), layout="constrained")
    before, after = figure.subplots(1, 2, sharex=True, sharey=True)
    _draw_map(before, story.before, f"before, at {story.before.stamp_s:.0f} s")
    _draw_map(after, story.after, f"after, at {story.after.stamp_s:.0f} s")
    for track in story.tracks.values():
        after.plot([p[0] for p in track], [p[1] for p in track], color=FLIGHT, lw=1.2, ls=":")
    return _svg(figure)


def _draw_map(axes: Axes, mesh: MeshStatus, title: str) -> None:
    placed = {node.id: node for node in mesh.nodes if position_is_known(node)}
    for node in placed.values():
        for other in node.neighbours:
            if other in placed and node.on and placed[other].on and other > node.id:
                _draw_link(axes, node, placed[other], LINK, 0.8)
    for node in placed.values():
        if node.connected and node.on and node.next_hop in placed and node.next_hop != node.id:
            _draw_link(axes, node, placed[node.next_hop], CONNECTED, 2.2)
    size = 190 if len(placed) <= 40 else 45
    for node in placed.values():
        x, y = node.position[0], node.position[1]
        colour, shape = _look(node)
        axes.scatter(
            [x], [y], s=size, marker=shape, zorder=3, linewidths=1.5,
            facecolors=colour if node.on else "white",
            edgecolors="white" if node.on else colour,
        )  # fmt: skip
        if len(placed) <= 100:
            axes.text(
                x, y, str(node.id), ha="center", va="center_baseline", zorder=4, size=8,
                color="white" if node.on else OFF, weight="bold",
            )  # fmt: skip
    axes.set_title(title, loc="left", size=10)
    axes.set_aspect("equal")
    axes.margins(0.12)
    axes.set_xlabel("x, m")
    axes.grid(color="#e7ebf1", lw=0.6)
    axes.set_axisbelow(True)


def _draw_link(axes: Axes, a: NodeStatus, b: NodeStatus, colour: str, width: float) -> None:
    xs, ys = zip(a.position[:2], b.position[:2])
    axes.plot(xs, ys, color=colour, lw=width, zorder=1)


def _look(node: NodeStatus) -> tuple[str, str]:
    shape = "s" if node.role == Role.GATEWAY else "o"
    if not node.on:
        return OFF, shape
    if node.role == Role.GATEWAY:
        return GATEWAY, shape
    return (CONNECTED if node.connected else LOST), shape


def _mark_events(axes: Axes, story: RunStory) -> None:
    marks: Sequence[tuple[MeshEventKind, str, str, Callable[[int], str]]] = (
        (MeshEventKind.POWER_OFF, OFF, "v", lambda node: f"{node} off"),
        (MeshEventKind.POWER_ON, OFF, "^", lambda node: f"{node} on"),
        (MeshEventKind.FLIGHT_DECIDED, FLIGHT, "D", lambda node: f"{node} flies"),
    )
    for kind, colour, shape, words in marks:
        found = [event for event in story.events if event.kind == kind.value]
        for event in found:
            axes.plot([event.stamp_s], [104], marker=shape, color=colour, ms=6, clip_on=False)
            if len(found) <= 12:
                axes.annotate(
                    words(event.node), (event.stamp_s, 104), (4, 8), textcoords="offset points",
                    size=8, color=colour, annotation_clip=False,
                )  # fmt: skip


def _figure(
    height_in: float, rows: int = 1, heights: Sequence[float] = (1,)
) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    axes = figure.subplots(
        rows, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    for one in axes[:, 0]:
        one.spines[["top", "right"]].set_visible(False)
        one.grid(axis="y", color="#e7ebf1", lw=0.6)
        one.set_axisbelow(True)
    return figure, list(axes[:, 0])


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    # Without a date, so that the same run gives the same page.
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue().partition("<svg")[1] + text.getvalue().partition("<svg")[2]
