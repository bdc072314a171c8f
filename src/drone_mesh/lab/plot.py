"""One figure of an experiment as a file of its own."""

from __future__ import annotations

from pathlib import Path

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.figures import axis_drawing
from drone_mesh.lab.healing_figures import (
    HEALED,
    PHASES_OF_REPAIR,
    phases_drawing,
    survival_drawing,
)
from drone_mesh.lab.results import Results
from drone_mesh.report.drawing import in_style, svg_of_its_own


def draw_alone(results: Results, name: str, out: Path) -> None:
    """Write one figure as SVG, light and dark: an axis, HEALED or PHASES_OF_REPAIR.

    Raises ConfigurationError if there is no such figure, or the file cannot be written.
    """
    with in_style():
        if name in results.loaded.axes:
            drawing = axis_drawing(results, name)
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
