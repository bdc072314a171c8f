"""The figures of how meshes heal: their phases, and the share healed over time (matplotlib)."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from drone_mesh.lab.experiment import Cell, as_text
from drone_mesh.lab.figures import (
    COLOURS,
    WIDTH_IN,
    Drawing,
    add_legend,
    distinct,
    line_style,
    panels,
    series_axis,
    short,
    style,
)
from drone_mesh.lab.results import Results, number
from drone_mesh.lab.statistics import kaplan_meier
from drone_mesh.view.palette import LIGHT

PHASES = (
    ("t_detect_s", "detect", "#56B4E9"),
    ("t_decide_s", "wait and decide", "#CC79A7"),
    ("t_fly_s", "fly", "#E69F00"),
    ("t_reroute_s", "re-route", "#009E73"),
)
HEALED, PHASES_OF_REPAIR = "healed_over_time", "phases"


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
    style(axes, grid="x")
    figure.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    caption = (
        "Mean over the runs that healed (n). Detect: until the first router notices; wait and "
        "decide: until the first flight; fly: until the last landing; re-route: until all are "
        "served. Without a flight everything after the first notice is re-routing."
    )
    return Drawing(PHASES_OF_REPAIR, "Phases of the repair", caption, figure)


def survival_drawing(results: Results) -> Drawing | None:
    """Share of runs that have not healed yet, over time (Kaplan-Meier)."""
    series = series_axis(results)
    others = [name for name in results.loaded.axes if name != series]
    groups = distinct(
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
    figure, grid = panels(len(curves), 2.4)
    for axes, (key, lines) in zip(grid, curves.items()):
        for order, (label, curve, end_s) in enumerate(lines):
            xs = [t for t, _ in curve] + [end_s]
            ys = [1 - share for _, share in curve] + [1 - curve[-1][1]]
            axes.step(xs, ys, where="post", color=COLOURS[order % len(COLOURS)], lw=1.5,
                      ls=line_style(order), label=label)  # fmt: skip
        words = [f"{results.axis_names[name]} = {value}" for name, value in zip(others, key)]
        axes.set_title(", ".join(words), loc="left", fontsize=8)
        axes.set_ylim(0, 1.03)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_xlabel("s after the fault", fontsize=8)
        style(axes)
    add_legend(figure, grid[0], results.axis_names.get(series or ""))
    caption = (
        "Share of runs that have healed (Kaplan-Meier): a curve below 100 % has censored runs."
    )
    return Drawing(HEALED, "Healed over time", caption, figure)


def _cell_name(cell: Cell) -> str:
    return ", ".join(short(as_text(value)) for value in cell.values.values()) or "all runs"
