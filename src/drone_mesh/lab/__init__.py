"""The lab: an experiment is one file, thousands of seeded runs, and one report. Without ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drone_mesh.by_name import on_demand

if TYPE_CHECKING:
    from drone_mesh.lab.metrics import measure_all
    from drone_mesh.lab.policies import PlacementPolicy, RoutingPolicy
    from drone_mesh.lab.record import RunRecord
    from drone_mesh.lab.run_report.page import render_page
    from drone_mesh.lab.run_report.story import tell_story
    from drone_mesh.lab.sequence import run_sequence
    from drone_mesh.view.table import mesh_table

__all__ = [
    "PlacementPolicy",
    "RoutingPolicy",
    "RunRecord",
    "measure_all",
    "mesh_table",
    "render_page",
    "run_sequence",
    "tell_story",
]

__getattr__ = on_demand(
    __name__,
    {  # each with other requirements, so that a name loads only its own
        "PlacementPolicy": "drone_mesh.lab.policies",
        "RoutingPolicy": "drone_mesh.lab.policies",
        "RunRecord": "drone_mesh.lab.record",
        "measure_all": "drone_mesh.lab.metrics",
        "mesh_table": "drone_mesh.view.table",
        "render_page": "drone_mesh.lab.run_report.page",
        "run_sequence": "drone_mesh.lab.sequence",
        "tell_story": "drone_mesh.lab.run_report.story",
    },
)
