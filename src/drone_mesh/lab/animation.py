"""A repair as an animation: inline SVG that plays in any browser."""

from __future__ import annotations

import itertools
from typing import Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.lab.record import RunRecord
from drone_mesh.state.model import MeshStatus, NodeStatus

SHOWN_BEFORE_S = 3.0
SHOWN_AFTER_S = 4.0
MOST_FRAMES = 90
FRAME_S = 0.25  # of the viewer's time
WIDTH = 720
MARGIN = 24
HIGHEST = 500  # of the drawing, without its margins
SERVED, LOST, OFF, GATEWAY = "#009E73", "#D55E00", "#c5cad3", "#6d3fd1"


def animate_repair(states: Sequence[MeshStatus], record: RunRecord) -> str:
    """SVG text of the time around the repair; empty if there was none."""
    if record.fault_s is None:
        return ""
    end_s = record.end_s if record.healed_at_s is None else record.healed_at_s
    shown = [
        state
        for state in states
        if record.fault_s - SHOWN_BEFORE_S <= state.stamp_s <= end_s + SHOWN_AFTER_S
    ]
    if len(shown) < 2:
        return ""
    stride = -(-len(shown) // MOST_FRAMES)
    frames = [*shown[::stride], shown[-1]]
    served = {sample.now_s: sample.served for sample in record.samples}
    scale = _Scale(frames)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {scale.height:.0f}" '
        'class="animation" role="img">',
        f'<rect width="{WIDTH}" height="{scale.height:.0f}" fill="#ffffff"/>',
    ]
    parts += _links(frames, scale)
    for index in range(len(frames[0].nodes)):
        parts.append(_drone([frame.nodes[index] for frame in frames], frames, served, scale))
    texts = [f"{state.stamp_s - record.fault_s:+.0f} s" for state in frames]
    for start, stop, text in _runs(texts):
        parts.append(
            f'<text x="{MARGIN}" y="18" font-size="13" font-family="sans-serif" fill="#333" '
            f'visibility="hidden">{text}{_visible(start, stop, len(frames))}</text>'
        )
    parts.append("</svg>")
    return "\n".join(parts)


class _Scale:
    def __init__(self, frames: Sequence[MeshStatus]) -> None:
        xs = [node.position[0] for frame in frames for node in frame.nodes]
        ys = [node.position[1] for frame in frames for node in frame.nodes]
        self._x0, self._y1 = min(xs), max(ys)
        width, height = max(max(xs) - min(xs), 1.0), max(max(ys) - min(ys), 1.0)
        self._factor = min((WIDTH - 2 * MARGIN) / width, HIGHEST / height)
        self._left = (WIDTH - width * self._factor) / 2
        self.height = height * self._factor + 2 * MARGIN

    def at(self, node: NodeStatus) -> tuple[float, float]:
        return (
            self._left + (node.position[0] - self._x0) * self._factor,
            MARGIN + (self._y1 - node.position[1]) * self._factor,
        )


def _links(frames: Sequence[MeshStatus], scale: _Scale) -> list[str]:
    """The routes in use; consecutive frames with the same routes share them."""
    pictures = []
    for frame in frames:
        nodes = {node.id: node for node in frame.nodes}
        lines = []
        for node in frame.nodes:
            if node.on and node.connected and node.role == Role.ROUTER:
                to = nodes.get(node.next_hop) if node.next_hop != NO_ROUTE else None
                if to is not None and to.on:
                    (x1, y1), (x2, y2) = scale.at(node), scale.at(to)
                    lines.append(f"M{x1:.0f} {y1:.0f}L{x2:.0f} {y2:.0f}")
        pictures.append("".join(lines))
    return [
        f'<path d="{path}" stroke="#9bb0c9" stroke-width="1.4" fill="none" visibility="hidden">'
        f"{_visible(start, stop, len(frames))}</path>"
        for start, stop, path in _runs(pictures)
        if path
    ]


def _drone(
    states: Sequence[NodeStatus],
    frames: Sequence[MeshStatus],
    served: dict[float, frozenset[int]],
    scale: _Scale,
) -> str:
    colours = []
    for node, frame in zip(states, frames):
        if not node.on:
            colours.append(OFF)
        elif node.role == Role.GATEWAY:
            colours.append(GATEWAY)
        else:
            colours.append(SERVED if node.id in served.get(frame.stamp_s, ()) else LOST)
    points = [scale.at(node) for node in states]
    x, y = points[0]
    radius = 7 if states[0].role == Role.GATEWAY else 5
    inside = ""
    if len(set(colours)) > 1:
        inside += _animate("fill", colours, "discrete")
    if len(set(points)) > 1:
        inside += _animate("cx", [f"{x:.1f}" for x, _ in points], "linear")
        inside += _animate("cy", [f"{y:.1f}" for _, y in points], "linear")
    title = f"<title>node {states[0].id}</title>"
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colours[0]}" stroke="#fff" '
        f'stroke-width="1">{title}{inside}</circle>'
    )


def _animate(attribute: str, values: Sequence[str], mode: str) -> str:
    """Gives an attribute one value per frame."""
    return (
        f'<animate attributeName="{attribute}" values="{";".join(values)}" '
        f'dur="{FRAME_S * len(values):g}s" calcMode="{mode}" repeatCount="indefinite"/>'
    )


def _visible(start: int, stop: int, frames: int) -> str:
    """Makes an element visible in the frames start..stop-1."""
    changes = sorted({0, start, stop} - {frames})
    times = ";".join(f"{change / frames:.4f}" for change in changes)
    words = ";".join("visible" if start <= change < stop else "hidden" for change in changes)
    return (
        f'<animate attributeName="visibility" values="{words}" keyTimes="{times}" '
        f'dur="{FRAME_S * frames:g}s" calcMode="discrete" repeatCount="indefinite"/>'
    )


def _runs(items: Sequence[str]) -> list[tuple[int, int, str]]:
    """Runs of equal items: first index, index after the last, item."""
    found = []
    start = 0
    for item, same in itertools.groupby(items):
        stop = start + len(list(same))
        found.append((start, stop, item))
        start = stop
    return found
