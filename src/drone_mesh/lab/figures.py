"""The figures of a report: over the axes of a sweep, phases of a repair, healed over time."""

from __future__ import annotations

import math
import re
from typing import Any, Literal, Mapping, NamedTuple, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from drone_mesh.lab.cells import Cell, as_text
from drone_mesh.lab.metrics.registry import METRICS, is_censored, is_share, unit_of
from drone_mesh.lab.results import Results, number
from drone_mesh.lab.statistics import Interval, kaplan_meier
from drone_mesh.lab.tables import summary_of
from drone_mesh.view.palette import LIGHT

WIDTH_IN = 7.2  # the text width of A4; the page scales it
# Okabe and Ito's palette, distinguishable for the colour-blind, without its yellow.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", LIGHT.ink)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")  # more than colours: no pair twice
PANELS_PER_ROW = 2
MOST_TICKS = 9
PHASES = (
    ("t_detect_s", "detect", "#56B4E9"),
    ("t_decide_s", "wait and decide", "#CC79A7"),
    ("t_fly_s", "fly", "#E69F00"),
    ("t_reroute_s", "re-route", "#009E73"),
)
HEALED, PHASES_OF_REPAIR = "healed_over_time", "phases"


class Drawing(NamedTuple):
    """A figure with its heading and caption; `name` is its file name."""

    name: str
    title: str
    caption: str
    figure: Figure


def _panels(count: int, row_in: float) -> tuple[Figure, list[Axes]]:
    """A figure with this many panels, in rows of this height."""
    columns = min(PANELS_PER_ROW, count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(WIDTH_IN, row_in * rows + 0.5), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for unused in grid[count:]:
        unused.set_visible(False)
    return figure, list(grid[:count])


def _add_legend(figure: Figure, panel: Axes, title: str | None) -> None:
    """Add one legend above all panels, with the entries of these axes."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=min(6, len(labels)), frameon=False,
        title=title, fontsize=8, title_fontsize=8,
    )  # fmt: skip


def axis_drawings(results: Results) -> list[Drawing]:
    """One figure per axis, with a panel for each metric."""
    axes = results.loaded.axes
    series = _series_axis(results)
    return [axis_drawing(results, axis) for axis in axes if axis != series or len(axes) == 1]


def _series_axis(results: Results) -> str | None:
    """The axis whose values are distinguished by colour."""
    compare = results.loaded.experiment.compare
    if compare is not None:
        return compare.over
    axes = results.loaded.axes
    return axes[-1] if len(axes) > 1 else None


def axis_drawing(results: Results, axis: str) -> Drawing:
    series = _series_axis(results)
    if series == axis:
        series = None
    figure, shown = _panels(len(results.metrics), 2.5)
    others = [name for name in results.loaded.axes if name not in (axis, series)]
    last = results.loaded.cells[-1].values  # for the axes that a figure cannot show
    fixed = {name: last[name] for name in others if not _follows(results, name, axis)}
    for panel, metric in zip(shown, results.metrics):
        _draw_metric(panel, results, metric, axis, series, fixed)
    if series is not None:
        _add_legend(figure, shown[0], results.axis_names[series])
    caption = "Bands: 95 % intervals (BCa bootstrap of the mean; Wilson for shares)."
    if fixed:
        held = ", ".join(
            f"{results.axis_names[name]} = {as_text(value)}" for name, value in fixed.items()
        )
        caption += f" Drawn for {held}; the tables have all cells."
    if any(map(is_censored, results.metrics)):
        caption += " Times to heal include only runs that healed; compare the share healed as well."
    return Drawing(
        re.sub(r"\W", "_", f"axis_{axis}"), f"Over {results.axis_names[axis]}", caption, figure
    )


def phases_drawing(results: Results) -> Drawing | None:
    """Stacked bars: the phases of the time to heal, mean of the runs that healed."""
    bars: list[tuple[str, list[float], int]] = []
    for index, cell in enumerate(results.loaded.cells):
        healed = [
            row for row in results.of_cell(index).values() if number(row, "t_total_s") is not None
        ]
        if healed:
            means = [
                sum(number(row, name) or 0.0 for row in healed) / len(healed) for name, *_ in PHASES
            ]
            bars.append((_cell_name(cell), means, len(healed)))
    if not bars or not any(sum(means) for _, means, _ in bars):
        return None
    figure = Figure(figsize=(WIDTH_IN, 0.9 + 0.24 * len(bars)), layout="constrained")
    axes = figure.subplots()
    left = [0.0] * len(bars)
    for place, (_name, words, colour) in enumerate(PHASES):
        widths = [means[place] for _, means, _ in bars]
        axes.barh(range(len(bars)), widths, left=left, color=colour, label=words, height=0.7)
        left = [a + b for a, b in zip(left, widths)]
    for row, (total, (_, _, n)) in enumerate(zip(left, bars)):
        axes.text(total, row, f"  n = {n}", va="center", fontsize=7, color=LIGHT.muted)
    axes.set_yticks(range(len(bars)), [name for name, *_ in bars], fontsize=7)
    axes.invert_yaxis()
    axes.margins(x=0.1)
    axes.set_xlabel("s after the fault", fontsize=8)
    _style(axes, grid="x")
    figure.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    caption = (
        "Mean over the runs that healed (n). Detect: until the first router notices; wait and "
        "decide: until the first flight; fly: until the last landing; re-route: until all are "
        "served. Without a flight everything after the first notice is re-routing."
    )
    return Drawing(PHASES_OF_REPAIR, "Phases of the repair", caption, figure)


def survival_drawing(results: Results) -> Drawing | None:
    """Share of runs that have not healed yet, over time (Kaplan-Meier)."""
    series = _series_axis(results)
    others = [name for name in results.loaded.axes if name != series]
    groups = _distinct(
        tuple(as_text(cell.values[name]) for name in others) for cell in results.loaded.cells
    )[:4]
    curves: dict[tuple[str, ...], list[tuple[str, list[tuple[float, float]], float]]] = {}
    for index, cell in enumerate(results.loaded.cells):
        rows = results.of_cell(index).values()
        times = [(number(row, "t_total_s"), number(row, "observed_s")) for row in rows]
        watched = [(t, o) for t, o in times if o is not None]
        key = tuple(as_text(cell.values[name]) for name in others)
        if watched and key in groups:
            curve = kaplan_meier(
                [o if t is None else t for t, o in watched], [t is not None for t, _ in watched]
            )
            end_s = max(o for _, o in watched)
            label = as_text(cell.values[series]) if series else "all runs"
            curves.setdefault(key, []).append((label, curve, end_s))
    if not curves:
        return None
    figure, grid = _panels(len(curves), 2.4)
    for axes, (key, lines) in zip(grid, curves.items()):
        for order, (label, curve, end_s) in enumerate(lines):
            xs = [t for t, _ in curve] + [end_s]
            ys = [1 - share for _, share in curve] + [1 - curve[-1][1]]
            axes.step(xs, ys, where="post", color=COLOURS[order % len(COLOURS)], lw=1.5,
                      ls=_line_style(order), label=label)  # fmt: skip
        words = [f"{results.axis_names[name]} = {value}" for name, value in zip(others, key)]
        axes.set_title(", ".join(words), loc="left", fontsize=8)
        axes.set_ylim(0, 1.03)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_xlabel("s after the fault", fontsize=8)
        _style(axes)
    _add_legend(figure, grid[0], results.axis_names.get(series or ""))
    caption = (
        "Share of runs that have healed (Kaplan-Meier): a curve below 100 % has censored runs."
    )
    return Drawing(HEALED, "Healed over time", caption, figure)


def _cell_name(cell: Cell) -> str:
    return ", ".join(_short(as_text(value)) for value in cell.values.values()) or "all runs"


def _draw_metric(
    axes: Axes,
    results: Results,
    metric: str,
    axis: str,
    series: str | None,
    fixed: Mapping[str, Any],
) -> None:
    cells = [
        (index, cell)
        for index, cell in enumerate(results.loaded.cells)
        if all(cell.values[name] == value for name, value in fixed.items())
    ]
    values = _distinct(cell.values[axis] for _, cell in cells)
    is_numeric = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
    lines = _distinct(cell.values[series] for _, cell in cells) if series else [None]
    for order, line in enumerate(lines):
        points: list[tuple[float, Interval]] = []
        for index, cell in cells:
            if series is not None and cell.values[series] != line:
                continue
            value = cell.values[axis]
            x = float(value) if is_numeric else float(values.index(value))
            interval = summary_of(results.of_cell(index), metric)
            if not math.isnan(interval.value):
                points.append((x, interval))
        points.sort(key=lambda point: point[0])
        _draw_points(axes, points, order, as_text(line), is_numeric, len(lines))
    axes.set_title(_metric_title(metric), loc="left", fontsize=9)
    axes.set_xlabel(results.axis_names[axis], fontsize=8)
    if is_numeric and len(values) <= MOST_TICKS:
        axes.set_xticks(values, [f"{value:g}" for value in values])
    elif not is_numeric:
        axes.set_xticks(range(len(values)), [_short(as_text(v)) for v in values])
        axes.margins(x=0.1)
    if is_share(metric) or (metric in METRICS and METRICS[metric].unit == "share"):
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    _style(axes)


def _draw_points(
    axes: Axes,
    points: Sequence[tuple[float, Interval]],
    order: int,
    label: str,
    is_numeric: bool,
    lines: int,
) -> None:
    colour = COLOURS[order % len(COLOURS)]
    if not points:
        axes.plot([], [], color=colour, label=label)
        return
    marker = MARKERS[order % len(MARKERS)]
    xs = [x for x, _ in points]
    means = [interval.value for _, interval in points]
    lows = [i.value if math.isnan(i.low) else i.low for _, i in points]
    highs = [i.value if math.isnan(i.high) else i.high for _, i in points]
    if is_numeric:
        axes.plot(
            xs, means, color=colour, marker=marker, ms=4, lw=1.4, ls=_line_style(order), label=label
        )
        axes.fill_between(xs, lows, highs, color=colour, alpha=0.16, lw=0)
        return
    shift = (order - (lines - 1) / 2) * 0.6 / max(lines, 1)
    xs = [x + shift for x in xs]
    below = [max(0.0, m - low) for m, low in zip(means, lows)]
    above = [max(0.0, high - m) for m, high in zip(means, highs)]
    axes.errorbar(
        xs, means, yerr=[below, above], color=colour, marker=marker, ms=5, lw=1.4, ls="",
        capsize=3, label=label,
    )  # fmt: skip


def _follows(results: Results, name: str, axis: str) -> bool:
    """Whether an axis has one value for each value of another, because they are zipped."""
    cells = results.loaded.cells
    pairs = {(as_text(cell.values[axis]), as_text(cell.values[name])) for cell in cells}
    return len(pairs) == len({value for value, _ in pairs})


def _distinct(values: Any) -> list[Any]:
    found: list[Any] = []
    for value in values:
        if value not in found:
            found.append(value)
    return found


def _metric_title(metric: str) -> str:
    """The metric's name, with its unit unless the name ends with it."""
    unit = unit_of(metric)
    return f"{metric} ({unit})" if unit else metric


def _short(text: str) -> str:
    text = text.rpartition(":")[2]
    return text if len(text) <= 22 else f"{text[:20]}..."


def _line_style(order: int) -> str:
    """Dashed once the colours repeat."""
    return "-" if order < len(COLOURS) else "--"


def _style(axes: Axes, grid: Literal["x", "y"] = "y") -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis=grid, color=LIGHT.grid, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
