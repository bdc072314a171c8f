"""Charts of a run: connected share, hops, and messages per node."""

from __future__ import annotations

import math
from typing import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, PercentFormatter

from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.drone.roles import Role
from drone_mesh.report.drawing import figure_with_rows, svg_of
from drone_mesh.report.story import RunStory
from drone_mesh.view.palette import LIGHT

MOST_NAMED = 12  # events of one kind that are labelled; more would overlap
LABEL_POINTS = (8, 18)  # above their marks; labels close to each other alternate
CLOSE_SHARE = 0.07  # of the run: labels closer than this would overlap
MOST_BARS_NAMED = 40  # nodes whose ids all fit below their bars


def timeline_figure(story: RunStory) -> str:
    """The connected share and the hops over time, with marks for what happened."""
    figure, (share, hops) = figure_with_rows(4.2, rows=2, heights=(2, 1))
    times = [sample.stamp_s for sample in story.samples]
    # A share of no routers does not exist: the line has a gap there.
    percent = [
        math.nan if sample.connected_share is None else 100 * sample.connected_share
        for sample in story.samples
    ]
    share.fill_between(times, percent, color=LIGHT.connected, alpha=0.15, lw=0)
    share.plot(times, percent, color=LIGHT.connected, lw=1.5)
    share.set_ylim(0, 108)
    share.set_ylabel("routers connected")
    share.yaxis.set_major_formatter(PercentFormatter())
    _mark_events(share, story)
    hops.plot(times, [s.most_hops for s in story.samples], color=LIGHT.accent, label="most")
    hops.plot(times, [s.mean_hops for s in story.samples], color=LIGHT.gateway, label="mean")
    hops.set_ylabel("hops")
    hops.set_ylim(bottom=0)
    hops.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    hops.legend(loc="lower right", frameon=False, ncols=2, labelcolor=LIGHT.ink)
    hops.set_xlabel("simulated time, s")
    for axes in (share, hops):
        axes.set_xlim(times[0], max(times[-1], times[0] + 1))
    return svg_of(figure)


def messages_figure(story: RunStory) -> str:
    """Messages that each node sent."""
    ids = sorted(story.messages_of)
    figure, (axes,) = figure_with_rows(2.4)
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


def _mark_events(axes: Axes, story: RunStory) -> None:
    marks: Sequence[tuple[MeshEventKind, str, str, Callable[[int], str]]] = (
        (MeshEventKind.POWER_OFF, LIGHT.off, "v", lambda node: f"{node} off"),
        (MeshEventKind.POWER_ON, LIGHT.off, "^", lambda node: f"{node} on"),
        (MeshEventKind.FLIGHT_DECIDED, LIGHT.flying, "D", lambda node: f"{node} flies"),
    )
    length_s = story.samples[-1].stamp_s - story.samples[0].stamp_s
    for kind, colour, shape, words in marks:
        found = [event for event in story.events if event.kind == kind.value]
        height, before_s = LABEL_POINTS[0], -math.inf
        for event in found:
            axes.plot([event.stamp_s], [104], marker=shape, color=colour, ms=6, clip_on=False)
            if len(found) <= MOST_NAMED:
                close = event.stamp_s - before_s < CLOSE_SHARE * length_s
                height = LABEL_POINTS[close and height == LABEL_POINTS[0]]
                before_s = event.stamp_s
                axes.annotate(
                    words(event.node), (event.stamp_s, 104), (4, height), size=8, color=colour,
                    textcoords="offset points", annotation_clip=False,
                )  # fmt: skip
