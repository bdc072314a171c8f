"""The figures of a report over the axes of a sweep, and the style of all (matplotlib)."""

from __future__ import annotations

import math
import re
from typing import Any, Literal, Mapping, NamedTuple, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from drone_mesh.lab.experiment import as_text
from drone_mesh.lab.metrics.registry import METRICS, is_censored, unit_of
from drone_mesh.lab.results import Results, is_share
from drone_mesh.lab.statistics import Interval
from drone_mesh.lab.tables import summary_of
from drone_mesh.view.palette import LIGHT

WIDTH_IN = 7.2  # the text width of A4; the page scales it
# Okabe and Ito's palette, distinguishable for the colour-blind, without its yellow.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", LIGHT.ink)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")  # more than colours: no pair twice
PANELS_PER_ROW = 2
MOST_TICKS = 9


class Drawing(NamedTuple):
    """A figure with its heading and caption; `name` is its file name."""

    name: str
    title: str
    caption: str
    figure: Figure


def panels(count: int, row_in: float) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, in rows of this height."""
    columns = min(PANELS_PER_ROW, count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(WIDTH_IN, row_in * rows + 0.5), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for unused in grid[count:]:
        unused.set_visible(False)
    return figure, list(grid[:count])


def add_legend(figure: Figure, panel: Axes, title: str | None) -> None:
    """Add one legend above all panels, with the entries of these axes."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=min(6, len(labels)), frameon=False,
        title=title, fontsize=8, title_fontsize=8,
    )  # fmt: skip


def axis_drawings(results: Results) -> list[Drawing]:
    """One figure per axis, with a panel for each metric."""
    axes = results.loaded.axes
    series = series_axis(results)
    return [axis_drawing(results, axis) for axis in axes if axis != series or len(axes) == 1]


def series_axis(results: Results) -> str | None:
    """The axis whose values are distinguished by colour."""
    compare = results.loaded.experiment.compare
    if compare is not None:
        return compare.over
    axes = results.loaded.axes
    return axes[-1] if len(axes) > 1 else None


def axis_drawing(results: Results, axis: str) -> Drawing:
    series = series_axis(results)
    if series == axis:
        series = None
    figure, shown = panels(len(results.metrics), 2.5)
    others = [name for name in results.loaded.axes if name not in (axis, series)]
    last = results.loaded.cells[-1].values  # for the axes that a figure cannot show
    fixed = {name: last[name] for name in others if not _follows(results, name, axis)}
    for panel, metric in zip(shown, results.metrics):
        _draw_metric(panel, results, metric, axis, series, fixed)
    if series is not None:
        add_legend(figure, shown[0], results.axis_names[series])
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
    values = distinct(cell.values[axis] for _, cell in cells)
    is_numeric = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
    lines = distinct(cell.values[series] for _, cell in cells) if series else [None]
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
    axes.set_title(metric_title(metric), loc="left", fontsize=9)
    axes.set_xlabel(results.axis_names[axis], fontsize=8)
    if is_numeric and len(values) <= MOST_TICKS:
        axes.set_xticks(values, [f"{value:g}" for value in values])
    elif not is_numeric:
        axes.set_xticks(range(len(values)), [short(as_text(v)) for v in values])
        axes.margins(x=0.1)
    if is_share(metric) or (metric in METRICS and METRICS[metric].unit == "share"):
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    style(axes)


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
            xs, means, color=colour, marker=marker, ms=4, lw=1.4, ls=line_style(order), label=label
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


def distinct(values: Any) -> list[Any]:
    found: list[Any] = []
    for value in values:
        if value not in found:
            found.append(value)
    return found


def metric_title(metric: str) -> str:
    """The metric's name, with its unit unless the name ends with it."""
    unit = unit_of(metric)
    return f"{metric} ({unit})" if unit else metric


def short(text: str) -> str:
    text = text.rpartition(":")[2]
    return text if len(text) <= 22 else f"{text[:20]}..."


def line_style(order: int) -> str:
    """Dashed once the colours repeat."""
    return "-" if order < len(COLOURS) else "--"


def style(axes: Axes, grid: Literal["x", "y"] = "y") -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis=grid, color=LIGHT.grid, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
