"""The metrics of a run: one column each, with unit and definition."""

# The order of these imports is that of the columns of runs.csv.
# isort: off
from drone_mesh.lab.metrics import healing, movement, motion, traffic, harm, endurance

# isort: on
from drone_mesh.lab.metrics.movement import STACKED_M, covered
from drone_mesh.lab.metrics.registry import METRICS, Metric, listed, measure_all

__all__ = ["METRICS", "STACKED_M", "Metric", "covered", "harm", "healing", "listed", "measure_all"]
__all__ += ["endurance", "motion", "movement", "traffic"]
