"""The maps of a report."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from drone_mesh.lab.run_report.maps import draw_map
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
