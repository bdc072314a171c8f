"""The tables of a report, also as CSV and LaTeX for a paper."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from typing import Mapping, Sequence

from drone_mesh.lab.cells import as_text
from drone_mesh.lab.metrics.registry import METRICS, is_censored, is_share, unit_of
from drone_mesh.lab.results import Results, Row, number, paired
from drone_mesh.lab.statistics import (
    Interval,
    Survival,
    holm,
    mean_interval,
    paired_difference,
    plain,
    share_interval,
    survival,
)
from drone_mesh.lab.terminal import PROGRAM

HEALED_BY_S = (30.0, 60.0, 120.0, 300.0)
WORST_SHOWN = 8

_LATEX = {
    "\\": r"\textbackslash ", "%": r"\%", "_": r"\_", "&": r"\&", "#": r"\#",
    "{": r"\{", "}": r"\}", "$": r"\$", "<": r"\textless ", ">": r"\textgreater ",
}  # fmt: skip


@dataclass(frozen=True)
class Table:
    """Header and rows of text; `name` is its file name."""

    name: str
    title: str
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def to_csv(self) -> str:
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        return text.getvalue()

    def to_markdown(self) -> str:
        rows = [self.header, ["---"] * len(self.header), *self.rows]
        return (
            "".join(f"| {' | '.join(row)} |\n" for row in rows)
            .replace("| --- ", "|---")
            .replace("|--- |", "|---|")
        )

    def to_latex(self) -> str:
        """As LaTeX, for the booktabs package."""
        lines = [
            r"\begin{table}",
            rf"\caption{{{_latex(self.caption)}}}",
            rf"\begin{{tabular}}{{{'l' * len(self.header)}}}",
            r"\toprule",
            " & ".join(map(_latex, self.header)) + r" \\",
            r"\midrule",
            *(" & ".join(map(_latex, row)) + r" \\" for row in self.rows),
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"


def all_tables(results: Results) -> list[Table]:
    kinds = (cells_table, healing_table, paired_table, worst_table)
    return [table for kind in kinds if (table := kind(results)) is not None]


def warning_of(results: Results) -> str:
    """A warning if a repair had nothing to do in most draws, which dilutes figures; or empty."""
    cells = results.by_cell.values()
    drawn = [row for rows in cells for row in rows.values() if row["observed_s"]]
    whole = sum(row.get("split") == "0" for row in drawn)
    is_asked = {"healed", "t_total_s", "distance_total_m"} & set(results.metrics)
    if results.loaded.experiment.draws != "all" or not is_asked or 2 * whole <= len(drawn):
        return ""
    return (
        f"{whole} of {len(drawn)} draws needed no repair: their fault left every live router a "
        "path to a gateway. `draws: split` in the experiment counts only the others."
    )


def summary_of(rows: Mapping[int, Row], metric: str) -> Interval:
    """A metric over the runs of a cell: a share with Wilson, otherwise a mean with BCa."""
    values = [value for row in rows.values() if (value := number(row, metric)) is not None]
    if is_share(metric):
        return share_interval(round(sum(values)), len(values))
    return mean_interval(values)


def survival_of(rows: Mapping[int, Row]) -> Survival:
    """Time to heal over the runs of a cell; unhealed runs are censored at their end."""
    times: list[float] = []
    seen: list[bool] = []
    for row in rows.values():
        healed_s, observed_s = number(row, "t_total_s"), number(row, "observed_s")
        if observed_s is not None:
            times.append(observed_s if healed_s is None else healed_s)
            seen.append(healed_s is not None)
    return survival(times, seen)


def cells_table(results: Results) -> Table:
    """One row per cell, one column per metric of the experiment."""
    metrics = [name for name in results.metrics if not is_censored(name)]
    rows = []
    for index, cell in enumerate(results.loaded.cells):
        counted, drawn = results.of_cell(index), results.drawn(index)
        split = sum(row.get("split") == "1" for row in drawn.values())
        rows.append(
            [
                *map(as_text, cell.values.values()),
                results.marked(index, len(counted)),
                f"{split} of {len(drawn)}",
                *(_shown(summary_of(counted, metric), metric) for metric in metrics),
            ]
        )
    header = [*results.axis_names.values(), "n", "split", *map(_with_unit, metrics)]
    caption = (
        "Means with 95 % BCa bootstrap intervals; shares with Wilson intervals. n: runs that "
        "count; split: draws whose fault left a live router without any path to a gateway."
    )
    return Table("cells", "Results by cell", caption, header, rows)


def healing_table(results: Results) -> Table | None:
    """Share healed by certain times, and the censored time to heal; None without faults."""
    cells = []
    for index, cell in enumerate(results.loaded.cells):
        runs = {r: row for r, row in results.of_cell(index).items() if row["observed_s"]}
        if runs:  # in the others nothing was to be healed
            totals = [number(row, "t_total_s") for row in runs.values()]
            healed = [math.inf if total_s is None else total_s for total_s in totals]
            end_s = min(float(row["observed_s"]) for row in runs.values())
            cells.append((cell, healed, end_s, survival_of(runs)))
    if not cells:
        return None
    columns = [by_s for by_s in HEALED_BY_S if any(by_s <= end_s for _, _, end_s, _ in cells)]
    rows = []
    for cell, healed, end_s, found in cells:
        n = found.events + found.censored
        shares = [
            "-"  # the runs end earlier
            if by_s > end_s
            else _percent(share_interval(sum(total_s <= by_s for total_s in healed), n))
            for by_s in columns
        ]
        rows.append(
            [
                *map(as_text, cell.values.values()),
                str(n),
                *shares,
                _percent(share_interval(found.events, n)),
                "-" if math.isnan(found.median) else f"{found.median:.3g}",
                f"{found.restricted_mean} to {found.until:.3g}",
            ]
        )
    header = [
        *results.axis_names.values(), "n", *(f"healed in {by_s:g} s" for by_s in columns),
        "healed at all", "median, s", "restricted mean, s",
    ]  # fmt: skip
    caption = (
        "Shares with Wilson intervals. Runs that did not heal are censored at their end and never "
        "averaged in: median of Kaplan-Meier (- if less than half healed), and the mean time up "
        "to the moment at which the first unhealed run ends."
    )
    return Table("healing", "Time to heal", caption, header, rows)


def paired_table(results: Results) -> Table | None:
    """Each value of the compared axis against its baseline, paired by seed."""
    compare = results.loaded.experiment.compare
    if compare is None:
        return None
    found = []
    spread: dict[tuple[int | None, str], float] = {}  # of the control, by its cell and metric
    baseline = as_text(compare.baseline)
    cells = [cell.texts for cell in results.loaded.cells]
    for index, texts in enumerate(cells):
        wanted = {**texts, compare.over: baseline}
        base = next((i for i, other in enumerate(cells) if other == wanted), None)
        if base is None or (base == index and not results.loaded.experiment.control):
            continue
        for metric in results.metrics:
            if base == index:
                compared = paired_difference(*results.control(base, metric))
                texts = {**texts, compare.over: f"{baseline}, other seeds"}
                spread[base, metric] = max(map(abs, compared.difference[1:3]))
            else:
                compared = paired_difference(*paired(*results.pairs(base, index), metric))
            seeds = max(results.marked(one, compared.difference.n) for one in (base, index))
            found.append((base if base != index else None, texts, metric, seeds, compared))
    adjusted = holm([compared.p for *_, compared in found])
    rows = [
        [
            *texts.values(), _with_unit(metric), n, str(compared.difference),
            _verdict(compared.difference, p, metric), "-" if math.isnan(p) else f"{p:.2g}",
            *([_against(compared.difference, spread.get((base, metric)))] if spread else []),
        ]
        for (base, texts, metric, n, compared), p in zip(found, adjusted)
    ]  # fmt: skip
    difference = f"difference to {baseline}"
    header = [*results.axis_names.values(), "metric", "seeds", difference, "", "p (Holm)"]
    caption = (
        f"Difference to {compare.over} = {baseline}, per seed (common random numbers): mean with "
        "95 % BCa bootstrap interval; Wilcoxon signed-rank test, Holm over the table. A time to "
        "heal counts where both healed."
    )
    if spread:
        header.append("spread of A/A")
        caption += (
            " Control (A/A): the baseline on other seeds against itself; the larger end of that "
            "interval is its spread. A difference within it is not larger than other draws make."
        )
    return Table("paired", "Paired comparison", caption, header, rows)


def worst_table(results: Results) -> Table | None:
    """The runs that healed last or not at all, with the command that repeats each."""
    ranked = []
    for index, cell in enumerate(results.loaded.cells):
        for repetition, row in results.of_cell(index).items():
            total_s = number(row, "t_total_s")
            if number(row, "observed_s") is None:
                continue
            share = number(row, "connected_share") or 0.0
            key = (math.inf if total_s is None else total_s, -share)
            words = zip(results.axis_names.values(), map(as_text, cell.values.values()))
            ranked.append((key, ", ".join(f"{a} {v}" for a, v in words), repetition, row))
    if not ranked:
        return None
    ranked.sort(key=lambda item: (item[0], item[1], item[2]), reverse=True)
    rows = [
        [
            label, str(repetition),
            "not healed" if math.isinf(key[0]) else f"{key[0]:.3g} s",
            f"{-key[1]:.1%}",
            row["run"],
        ]
        for key, label, repetition, row in ranked[:WORST_SHOWN]
    ]  # fmt: skip
    header = ["cell", "seed", "healed after", "connected at the end", "run"]
    caption = (
        "The runs that took longest. To repeat one with all its events: "
        f"{PROGRAM} show {results.folder} RUN, with --page FILE or --console for a page about it."
    )
    return Table("worst", "Worst seeds", caption, header, rows)


def _verdict(difference: Interval, p: float, metric: str) -> str:
    better = METRICS[metric].better if metric in METRICS else ""
    if math.isnan(p) or p >= 0.05 or not better:
        return ""
    return "better" if (difference.value < 0) == (better == "less") else "worse"


def _against(difference: Interval, spread: float | None) -> str:
    """Where the difference is, relative to that of the control; empty for the control itself."""
    if spread is None or math.isnan(spread) or math.isnan(difference.value):
        return ""
    return f"{'within' if abs(difference.value) <= spread else 'beyond'} {plain(spread)}"


def _with_unit(metric: str) -> str:
    unit = unit_of(metric)
    return f"{metric}, {unit}" if unit else metric


def _shown(interval: Interval, metric: str) -> str:
    return _percent(interval) if is_share(metric) else str(interval)


def _percent(interval: Interval) -> str:
    if math.isnan(interval.value):
        return "-"
    return f"{interval.value:.0%} [{interval.low:.0%}, {interval.high:.0%}]"


def _latex(text: str) -> str:
    for character, escaped in _LATEX.items():
        text = text.replace(character, escaped)
    return text
