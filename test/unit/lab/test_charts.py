"""Labels of what happened, above the chart of a run."""

from __future__ import annotations

from drone_mesh.lab.run_report.charts import grouped
from drone_mesh.state.model import EventRecord


def events(*happened: tuple[float, int]) -> list[EventRecord]:
    return [EventRecord(at_s, node, "power off") for at_s, node in happened]


def test_events_close_to_each_other_share_a_label():
    found = events((10.0, 2), (10.0, 3), (12.0, 1), (20.0, 7))
    assert list(grouped(found, "off", close_s=5.0)) == [(10.0, "2, 3, 1 off"), (20.0, "7 off")]


def test_a_label_names_a_few_nodes_of_a_crowd():
    found = events(*((10.0, node) for node in range(6)))
    assert list(grouped(found, "off", close_s=5.0)) == [(10.0, "0, 1, 2, 3, … off")]
