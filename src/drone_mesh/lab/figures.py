"""The figures of a report (matplotlib)."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any, Literal, Mapping, NamedTuple, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import Cell, as_text
from drone_mesh.lab.metrics import METRICS
from drone_mesh.lab.results import Results, is_share, number
from drone_mesh.lab.statistics import Interval, kaplan_meier
from drone_mesh.lab.tables import summary_of
from drone_mesh.report.drawing import in_style, svg_of_its_own
from drone_mesh.view.palette import LIGHT

WIDTH_IN = 7.2  # the text width of A4; the page scales it
# Okabe and Ito's palette, distinguishable for the colour-blind, without its yellow.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", LIGHT.ink)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
PHASES = (
    ("t_detect_s", "detect", "#56B4E9"),
    ("t_decide_s", "wait and decide", "#CC79A7"),
    ("t_fly_s", "fly", "#E69F00"),
    ("t_reroute_s", "re-route", "#009E73"),
)
HEALED, PHASES_OF_REPAIR = "healed_over_time", "phases"
PANELS_PER_ROW = 2
MOST_TICKS = 9


class Drawing(NamedTuple):
    """A figure with its heading and caption; `name` is its file name."""

    name: str
    title: str
    caption: str
    figure: Figure

    def to_svg(self) -> str:
        """SVG text without a date, so that the same rows produce the same report."""
        text = io.StringIO()
        self.figure.savefig(text, format="svg", metadata={"Date": None})
        return text.getvalue().partition("<svg")[1] + text.getvalue().partition("<svg")[2]


def draw_alone(results: Results, name: str, out: Path) -> None:
    """Write one figure as SVG, light and dark: an axis, HEALED or PHASES_OF_REPAIR.

    Raises ConfigurationError if there is no such figure, or the file cannot be written.
    """
    with in_style():
        if name in results.loaded.axes:
            series = _series_axis(results)
            drawing = _axis_drawing(results, name, None if series == name else series)
        elif name in (HEALED, PHASES_OF_REPAIR):
            found = survival_drawing(results) if name == HEALED else phases_drawing(results)
            if found is None:
                raise ConfigurationError(f"{results.folder}: no run has a fault to heal")
            drawing = found
        else:
            names = ", ".join([*results.loaded.axes, HEALED, PHASES_OF_REPAIR])
            raise ConfigurationError(f"{results.folder}: no figure {name}; there are {names}")
        try:
            out.write_text(svg_of_its_own(drawing.figure), encoding="utf-8")
        except OSError as error:
            raise ConfigurationError(f"cannot write {out}: {error.strerror}") from error


def axis_drawings(results: Results) -> list[Drawing]:
    """One figure per axis, with a panel for each metric."""
    drawings = []
    series = _series_axis(results)
    for axis in results.loaded.axes:
        if axis == series and len(results.loaded.axes) > 1:
            continue
        drawings.append(_axis_drawing(results, axis, series if axis != series else None))
    return drawings


def _series_axis(results: Results) -> str | None:
    """The axis whose values are distinguished by colour."""
    compare = results.loaded.experiment.compare
    if compare is not None:
        return compare.over
    axes = results.loaded.axes
    return axes[-1] if len(axes) > 1 else None


def _axis_drawing(results: Results, axis: str, series: str | None) -> Drawing:
    metrics = results.metrics
    rows = math.ceil(len(metrics) / PANELS_PER_ROW)
    figure = Figure(figsize=(WIDTH_IN, 2.5 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, PANELS_PER_ROW, squeeze=False)
    others = [name for name in results.loaded.axes if name not in (axis, series)]
    fixed = _most_common(results, [name for name in others if not _follows(results, name, axis)])
    for place, metric in enumerate(metrics):
        panel = panels[place // PANELS_PER_ROW][place % PANELS_PER_ROW]
        _draw_metric(panel, results, metric, axis, series, fixed)
    for place in range(len(metrics), rows * PANELS_PER_ROW):
        panels[place // PANELS_PER_ROW][place % PANELS_PER_ROW].set_visible(False)
    handles, labels = panels[0][0].get_legend_handles_labels()
    if series is not None:
        figure.legend(
            handles, labels, loc="outside upper center", ncols=min(6, len(labels)), frameon=False,
            title=results.axis_names[series], fontsize=8, title_fontsize=8,
        )  # fmt: skip
    caption = "Bands: 95 % intervals (BCa bootstrap of the mean; Wilson for shares)."
    if fixed:
        held = ", ".join(
            f"{results.axis_names[name]} = {as_text(value)}" for name, value in fixed.items()
        )
        caption += f" Drawn for {held}; the tables have all cells."
    if any(_is_censored(metric) for metric in metrics):
        caption += " Times to heal include only runs that healed; compare the share healed as well."
    return Drawing(f"axis_{_file_name(axis)}", f"Over {results.axis_names[axis]}", caption, figure)


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
    axes.set_title(metric_title(metric), loc="left", fontsize=9)
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
    if not points:
        axes.plot([], [], color=COLOURS[order % len(COLOURS)], label=label)
        return
    colour = COLOURS[order % len(COLOURS)]
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
    panels = math.ceil(len(curves) / PANELS_PER_ROW)
    figure = Figure(figsize=(WIDTH_IN, 2.4 * panels + 0.5), layout="constrained")
    grid = figure.subplots(panels, min(PANELS_PER_ROW, len(curves)), squeeze=False).ravel()
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
    for axes in grid[len(curves) :]:
        axes.set_visible(False)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(6, len(labels)),
                  frameon=False, fontsize=8, title=results.axis_names.get(series or ""),
                  title_fontsize=8)  # fmt: skip
    caption = (
        "Share of runs that have healed (Kaplan-Meier): a curve below 100 % has censored runs."
    )
    return Drawing(HEALED, "Healed over time", caption, figure)


def _most_common(results: Results, axes: Sequence[str]) -> dict[str, Any]:
    """A value for each axis that a figure cannot show: the last of its list."""
    return {axis: results.loaded.cells[-1].values[axis] for axis in axes}


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


def metric_title(metric: str) -> str:
    """The metric's name, with its unit unless the name ends with it."""
    unit = METRICS[metric].unit if metric in METRICS else ""
    is_said = unit in ("", "0/1", metric) or metric.endswith(f"_{unit}")
    return metric if is_said else f"{metric} ({unit})"


def _is_censored(metric: str) -> bool:
    return metric in METRICS and METRICS[metric].censored


def _cell_name(cell: Cell) -> str:
    return ", ".join(_short(as_text(value)) for value in cell.values.values()) or "all runs"


def _short(text: str) -> str:
    text = text.rpartition(":")[2]
    return text if len(text) <= 22 else f"{text[:20]}..."


def _file_name(axis: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in axis)


def _line_style(order: int) -> str:
    """Dashed once the colours repeat."""
    return "-" if order < len(COLOURS) else "--"


def _style(axes: Axes, grid: Literal["x", "y"] = "y") -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis=grid, color=LIGHT.grid, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
