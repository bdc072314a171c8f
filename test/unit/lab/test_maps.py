"""The maps of a report."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from drone_mesh.lab.run_report.maps import draw_map, draw_motion
from drone_mesh.state.model import MeshStatus, NodeStatus

PIXELS_PER_POINT = 100 / 72  # at the resolution of matplotlib's figures


def test_drones_at_one_position_stand_side_by_side():
    axes = Figure(dpi=100).add_subplot()
    draw_map(axes, MeshStatus(1.0, [NodeStatus(n, position=(4.0, 4.0, 0.0)) for n in range(3)]), "")
    dots = list(axes.collections)
    centres = [dot.get_offset_transform().transform(dot.get_offsets())[0] for dot in dots]
    width = math.sqrt(dots[0].get_sizes()[0]) * PIXELS_PER_POINT
    gaps = [math.dist(a, b) for i, a in enumerate(centres) for b in centres[:i]]
    assert min(gaps) >= width


def test_arrows_lead_to_where_drones_are_flown_and_a_link_that_will_break_is_dashed():
    axes = Figure(dpi=100).add_subplot()
    near = NodeStatus(0, position=(0.0, 0.0, 0.0))
    flown = NodeStatus(3, position=(8.0, 0.0, 0.0), heading=(20.0, 5.0, 0.0))
    draw_motion(axes, MeshStatus(1.0, [near, flown]), breaking=[(0, 3)])
    (link,) = axes.lines
    assert (list(link.get_xdata()), link.get_linestyle()) == ([0.0, 8.0], "--")
    (arrow,) = axes.texts
    assert (tuple(arrow.xy), tuple(arrow.xyann)) == ((20.0, 5.0), (8.0, 0.0))
