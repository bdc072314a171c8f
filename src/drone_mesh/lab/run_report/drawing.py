"""Figures as SVG text whose colours follow the page's light or dark theme (matplotlib)."""

from __future__ import annotations

import io
import re
from typing import ContextManager, Sequence

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drone_mesh.view.palette import DARK, LIGHT, Palette, variable_names

WIDTH_IN = 10.0  # the page scales it
_STYLE = {
    "axes.edgecolor": LIGHT.muted,
    "axes.facecolor": "none",
    "axes.labelcolor": LIGHT.muted,
    "figure.facecolor": "none",
    "grid.color": LIGHT.grid,
    "grid.linewidth": 0.6,
    "savefig.facecolor": "none",
    "svg.hashsalt": "drone_mesh",  # so that the same run produces the same page
    "text.color": LIGHT.ink,
    "xtick.color": LIGHT.muted,
    "ytick.color": LIGHT.muted,
}
_VARIABLES = {colour: f"var(--{name})" for colour, name in variable_names(LIGHT).items()}


def in_style() -> ContextManager[None]:
    """Figures that are drawn in this context suit `svg_of` and `svg_of_its_own`."""
    return matplotlib.rc_context(_STYLE)


def figure_with(
    height_in: float, rows: int = 1, columns: int = 1, heights: Sequence[float] = (1,)
) -> tuple[Figure, list[Axes]]:
    """A figure with axes that share their x axis; those in columns show the same area."""
    with in_style():
        figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        grid = figure.subplots(
            rows, columns, sharex=True, sharey=columns > 1, squeeze=False,
            gridspec_kw={"height_ratios": heights},
        )  # fmt: skip
    for one in grid.ravel():
        one.spines[["top", "right"]].set_visible(columns > 1)
        one.grid(axis="y" if columns == 1 else "both")
        one.set_axisbelow(True)
    return figure, list(grid.ravel())


def svg_of(figure: Figure) -> str:
    """The figure as an SVG element, with each colour of the palette as its CSS variable."""
    with in_style():
        drawing = svg_element(figure)
    return re.sub(
        r"#[0-9a-f]{6}\b", lambda found: _VARIABLES.get(str(found[0]), str(found[0])), drawing
    )


def svg_element(figure: Figure) -> str:
    """The figure as an SVG element in its own colours, without a date."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return "".join(text.getvalue().partition("<svg")[1:])


def svg_of_its_own(figure: Figure) -> str:
    """The figure as an SVG file, which is light or dark as its viewer prefers."""
    start, end, drawing = svg_of(figure).partition(">")
    style = f"svg{{background:var(--card);{_css(LIGHT)}}}"
    style += f"@media(prefers-color-scheme:dark){{svg{{{_css(DARK)}}}}}"
    return f"{start}{end}<style>{style}</style>{drawing}"


def _css(palette: Palette) -> str:
    return ";".join(f"--{name}:{colour}" for colour, name in variable_names(palette).items())
