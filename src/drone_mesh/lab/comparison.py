"""Paired differences: the same seed, another technique or another version of the code."""

from __future__ import annotations

from pathlib import Path
from typing import Sequence, Tuple

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.results import Row, load_results, paired
from drone_mesh.lab.statistics import holm, mean_interval, paired_difference
from drone_mesh.lab.terminal import PROGRAM

_Pairs = Tuple[str, Sequence[Row], Sequence[Row]]
"""A label, and two groups of runs with the same seeds, in the same order."""


def print_cells(folder: Path, a: str, b: str, metrics: Sequence[str]) -> None:
    """Print a table: metrics over the seeds that both cells have, with Holm over the table.

    Raises ConfigurationError for unknown cells or metrics, and for a cell of mixed code.
    """
    results = load_results(folder)
    cells = results.find_cell(a), results.find_cell(b)
    a_runs, b_runs = results.pairs(*cells)
    chosen = list(metrics) or results.metrics
    results.check_columns(chosen)
    codes = _one_code(a_runs), _one_code(b_runs)
    differ = codes[0].partition(" ")[0] != codes[1].partition(" ")[0]  # more than the techniques
    for name, cell, code in zip("AB", cells, codes):
        print(f"{name}: {results.loaded.cells[cell].label}{f', code {code}' if differ else ''}")
    _print_table([("", a_runs, b_runs)], chosen)


def print_folders(a: Path, b: Path, metrics: Sequence[str]) -> None:
    """The same of all runs that two folders have in common, by cell: what other code changed.

    Raises ConfigurationError if there are none, too.
    """
    results, other = load_results(a), load_results(b)
    chosen = list(metrics) or results.metrics
    results.check_columns(chosen)
    other.check_columns(chosen)
    found: list[_Pairs] = []
    for index, cell in enumerate(results.loaded.cells):
        rows = [row for _, row in sorted(results.of_cell(index).items())]
        rows = [row for row in rows if row["run"] in other.rows]
        if rows:
            found.append((cell.label, rows, [other.rows[row["run"]] for row in rows]))
    if not found:
        raise ConfigurationError(f"{a} and {b} have no run in common: same cell, seed and metrics")
    for name, folder, groups in zip("AB", (a, b), list(zip(*found))[1:]):
        print(f"{name}: {folder}, code {', '.join(sorted(set(map(_one_code, groups))))}")
    _print_table(found, chosen)


def _one_code(rows: Sequence[Row]) -> str:
    codes = sorted({row["code"] for row in rows})
    if len(codes) > 1:
        raise ConfigurationError(
            f"a cell mixes runs of different code ({', '.join(codes)}): `{PROGRAM} run` with "
            "--again repeats the older"
        )
    return codes[0] if codes else "unknown"


def _print_table(found: Sequence[_Pairs], metrics: Sequence[str]) -> None:
    print(f"{'metric':20} {'seeds':>5}  {'A':26} {'B':26} {'B - A, paired':28} {'p (Holm)':>9}")
    columns = [paired(a, b, metric) for _label, a, b in found for metric in metrics]
    differences = [paired_difference(xs, ys) for xs, ys in columns]
    lines = zip(columns, differences, holm([one.p for one in differences]))
    for label, _a, _b in found:
        if label:
            print(label)
        for metric, ((xs, ys), compared, p) in zip(metrics, lines):
            print(
                f"{metric:20} {len(xs):5}  {mean_interval(xs)!s:26} {mean_interval(ys)!s:26} "
                f"{compared.difference!s:28} {p:9.2g}"
            )
    print("means with 95 % BCa bootstrap intervals; p: Wilcoxon signed-rank, Holm over the rows")
