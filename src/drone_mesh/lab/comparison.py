"""Paired differences between cells: the same seed, another technique."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Sequence

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.results import Results, load_results, number
from drone_mesh.lab.statistics import Interval, holm, mean_interval, paired_difference


class ComparedMetric(NamedTuple):
    """One metric in two cells."""

    metric: str
    pairs: int  # seeds for which both cells have a value
    a: Interval
    b: Interval
    difference: Interval  # b - a
    p: float
    p_holm: float


def compare_cells(results: Results, a: int, b: int, metrics: Sequence[str]) -> list[ComparedMetric]:
    """Compare metrics over the seeds that both cells have; Holm over the metrics."""
    rows_a, rows_b = results.of_cell(a), results.of_cell(b)
    common = sorted(rows_a.keys() & rows_b.keys())
    found = []
    for metric in metrics:
        pairs = [(number(rows_a[r], metric), number(rows_b[r], metric)) for r in common]
        whole = [(x, y) for x, y in pairs if x is not None and y is not None]
        xs, ys = [x for x, _ in whole], [y for _, y in whole]
        paired = paired_difference(xs, ys)
        found.append((metric, len(whole), mean_interval(xs), mean_interval(ys), paired))
    adjusted = holm([paired.p for *_, paired in found])
    return [
        ComparedMetric(metric, n, x, y, paired.difference, paired.p, p)
        for (metric, n, x, y, paired), p in zip(found, adjusted)
    ]


def print_comparison(folder: Path, a: str, b: str, metrics: Sequence[str]) -> None:
    """Print the table. Raises ConfigurationError for unknown cells or metrics."""
    results = load_results(folder)
    cell_a, cell_b = results.find_cell(a), results.find_cell(b)
    chosen = list(metrics) or results.metrics
    columns = set(next(iter(results.rows.values()), {}))
    for metric in chosen:
        if metric not in columns:
            raise ConfigurationError(f"{folder}: runs.csv has no column {metric}")
    print(f"A: {results.loaded.cells[cell_a].label}")
    print(f"B: {results.loaded.cells[cell_b].label}")
    print(f"{'metric':20} {'seeds':>5}  {'A':26} {'B':26} {'B - A, paired':28} {'p (Holm)':>9}")
    for row in compare_cells(results, cell_a, cell_b, chosen):
        print(
            f"{row.metric:20} {row.pairs:5}  {row.a!s:26} {row.b!s:26} {row.difference!s:28} "
            f"{row.p_holm:9.2g}"
        )
    print("means with 95 % BCa bootstrap intervals; p: Wilcoxon signed-rank, Holm over the rows")
