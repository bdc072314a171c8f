"""Paired differences between cells: the same seed, another technique."""

from __future__ import annotations

from pathlib import Path
from typing import Sequence

from drone_mesh.lab.results import load_results
from drone_mesh.lab.statistics import holm, mean_interval, paired_difference


def print_comparison(folder: Path, a: str, b: str, metrics: Sequence[str]) -> None:
    """Print a table: metrics over the seeds that both cells have, with Holm over the metrics.

    Raises ConfigurationError for unknown cells or metrics.
    """
    results = load_results(folder)
    cell_a, cell_b = results.find_cell(a), results.find_cell(b)
    chosen = list(metrics) or results.metrics
    results.check_columns(chosen)
    print(f"A: {results.loaded.cells[cell_a].label}")
    print(f"B: {results.loaded.cells[cell_b].label}")
    print(f"{'metric':20} {'seeds':>5}  {'A':26} {'B':26} {'B - A, paired':28} {'p (Holm)':>9}")
    pairs = [results.paired(cell_a, cell_b, metric) for metric in chosen]
    differences = [paired_difference(xs, ys) for xs, ys in pairs]
    adjusted = holm([paired.p for paired in differences])
    for metric, (xs, ys), paired, p in zip(chosen, pairs, differences, adjusted):
        print(
            f"{metric:20} {len(xs):5}  {mean_interval(xs)!s:26} {mean_interval(ys)!s:26} "
            f"{paired.difference!s:28} {p:9.2g}"
        )
    print("means with 95 % BCa bootstrap intervals; p: Wilcoxon signed-rank, Holm over the rows")
