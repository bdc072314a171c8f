"""Maps of a run: the mesh before the first loss and at the end, with the paths flown."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.transforms import ScaledTranslation

from drone_mesh.drone.roles import Role
from drone_mesh.lab.run_report.drawing import figure_with, svg_of
from drone_mesh.lab.run_report.story import RunStory
from drone_mesh.state.condition import Condition, condition_of
from drone_mesh.state.links import LinkUse, links_by_use, shortest
from drone_mesh.state.model import MeshStatus, footprint, position_is_known
from drone_mesh.view.palette import LIGHT
from drone_mesh.view.scene import fan_offset, fan_out

MOST_LINKS = 2000  # per use: a picture of a crowd has no room for more
LINK_WIDTH = {LinkUse.KNOWN: 0.8, LinkUse.ROUTE: 2.2, LinkUse.LOST: 0.8}  # points
MOST_WITH_LARGE_DOTS, MOST_WITH_IDS = 40, 100
POINTS_PER_INCH = 72
MAP_WIDTH_IN, TITLE_IN, TALLEST_IN = 4.5, 0.9, 6.5
ROOM_SHARE, LEAST_ROOM_M = 0.08, 3.0


def maps_figure(story: RunStory) -> str:
    """Positions before the first loss and at the end, and the paths flown between them."""
    (west, east), (south, north) = (_limits(story, axis) for axis in (0, 1))
    height_in = MAP_WIDTH_IN * (north - south) / (east - west) + TITLE_IN
    figure, (before, after) = figure_with(min(height_in, TALLEST_IN), columns=2)
    before.set_xlim(west, east)
    before.set_ylim(south, north)
    draw_map(before, story.before, f"before, at {story.before.stamp_s:.0f} s")
    draw_map(after, story.after, f"after, at {story.after.stamp_s:.0f} s")
    for track in story.tracks.values():
        after.plot([p[0] for p in track], [p[1] for p in track], color=LIGHT.path, lw=1.2, ls=":")
    return svg_of(figure)


def _limits(story: RunStory, axis: int) -> tuple[float, float]:
    """The range of both maps along one axis, in metres: all nodes and paths, with a margin."""
    positions = [
        node.position[axis]
        for mesh in (story.before, story.after)
        for node in mesh.nodes
        if position_is_known(node)
    ]
    positions += [point[axis] for track in story.tracks.values() for point in track]
    low, high = min(positions, default=0.0), max(positions, default=0.0)
    room_m = max(LEAST_ROOM_M, ROOM_SHARE * (high - low))
    return low - room_m, high + room_m


def draw_map(axes: Axes, mesh: MeshStatus, title: str) -> None:
    placed = {node.id: node for node in mesh.nodes if position_is_known(node)}
    for use, links in links_by_use(list(placed.values())).items():
        for low, high in shortest(links, list(placed.values()), MOST_LINKS):
            xs, ys = zip(placed[low].position[:2], placed[high].position[:2])
            axes.plot(xs, ys, color=LIGHT.of_link(use), lw=LINK_WIDTH[use], zorder=1)
    for box in mesh.obstacles:
        axes.fill(*zip(*footprint(box)), facecolor=LIGHT.obstacle, edgecolor=LIGHT.muted, zorder=0)
    size = 190 if len(placed) <= MOST_WITH_LARGE_DOTS else 45  # points squared
    slots = fan_out(list(placed.values()))
    for node in placed.values():
        condition = condition_of(node)
        colour = LIGHT.of_node(node.role, condition)
        hollow = condition is Condition.OFF
        to_page = axes.transData
        if node.id in slots:
            offset = fan_offset(slots[node.id], size**0.5 / 2 / POINTS_PER_INCH)
            to_page = to_page + ScaledTranslation(*offset, axes.figure.dpi_scale_trans)
        is_gateway = node.role == Role.GATEWAY
        axes.scatter(
            [node.position[0]], [node.position[1]], s=size, marker="s" if is_gateway else "o",
            zorder=3 + is_gateway, linewidths=1.5, transform=to_page,
            facecolors=LIGHT.card if hollow else colour,
            edgecolors=colour if hollow else LIGHT.card,
        )  # fmt: skip
        if len(placed) <= MOST_WITH_IDS:
            axes.text(
                node.position[0], node.position[1], str(node.id), transform=to_page,
                ha="center", va="center_baseline", zorder=5, weight="bold",
                size=8 if node.id < 100 else 5.8, color=colour if hollow else LIGHT.card,
            )  # fmt: skip
    axes.set_title(title, loc="left", size=10)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
