"""The metrics of a run: one column each, with unit and definition."""

# The order of these imports is that of the columns of runs.csv.
# isort: off
from drone_mesh.lab.metrics import healing, movement, shape, motion, traffic

# isort: on
from drone_mesh.lab.metrics.movement import STACKED_M
from drone_mesh.lab.metrics.registry import METRICS, Metric, measure_all
from drone_mesh.lab.metrics.shape import covered

__all__ = [
    "METRICS",
    "STACKED_M",
    "Metric",
    "covered",
    "healing",
    "measure_all",
    "motion",
    "movement",
    "shape",
    "traffic",
]
