"""The report of an experiment: one self-contained HTML file, and figures and tables for a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Callable, Sequence

import jinja2

from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.lab.figures import (
    HEALED,
    PHASES_OF_REPAIR,
    Drawing,
    axis_drawing,
    axis_drawings,
    phases_drawing,
    survival_drawing,
)
from drone_mesh.lab.metrics import METRICS
from drone_mesh.lab.results import Results, load_results
from drone_mesh.lab.run_report.drawing import in_style, svg_element, svg_of_its_own
from drone_mesh.lab.store import EXPERIMENT
from drone_mesh.lab.tables import Table, all_tables, warning_of
from drone_mesh.lab.terminal import PROGRAM

_TEMPLATE = Path(__file__).resolve().parent / "report.html"
PNG_DPI = 200
EXPORTS = "exports"


class ReportError(MeshError):
    """There is nothing to report, or the page cannot be written."""


def write_report(folder: Path, out: Path | None, formats: Sequence[str]) -> list[Path]:
    """Write the page and the exports; returns the paths written. Raises MeshError."""
    results = load_results(folder)
    if not results.rows:
        raise ReportError(f"{folder}: no run is finished yet")
    if "parquet" in formats:
        _parquet_writer()  # a package that is missing ends it before all is drawn
    tables = all_tables(results)
    drawings = axis_drawings(results)
    drawings += [d for d in (phases_drawing(results), survival_drawing(results)) if d is not None]
    page = out or folder / "report.html"
    try:
        with page.open("w", encoding="utf-8", errors="backslashreplace") as file:  # of file names
            file.write(_render(results, tables, drawings))
        return [page, *_export(results, tables, drawings, formats)]
    except OSError as error:
        raise ReportError(f"cannot write {error.filename or page}: {error.strerror}") from error


def _render(results: Results, tables: Sequence[Table], drawings: Sequence[Drawing]) -> str:
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    experiment = results.loaded.experiment
    done = sum(planned.spec.run in results.rows for planned in results.plan)
    codes = sorted({row["code"].partition(" ")[0] for row in results.rows.values()})
    return template.render(
        title=experiment.title or experiment.name,
        name=experiment.name,
        done=done,
        planned=len(results.plan),
        cells=len(results.loaded.cells),
        seeds=len({one.spec.repetition for one in results.plan if not one.is_control}),
        failures=results.failures,
        draws=experiment.draws,
        warning=warning_of(results),
        tables={table.name: table for table in tables},
        drawings=[(drawing, svg_element(drawing.figure)) for drawing in drawings],
        definitions=[(name, METRICS[name]) for name in results.metrics if name in METRICS],
        codes=codes,
        mixed=any(len(results.codes(cell)) > 1 for cell in range(len(results.loaded.cells))),
        program=PROGRAM,
        sessions=results.sessions,
        experiment_text=(results.folder / EXPERIMENT).read_text(encoding="utf-8"),
    )


def _export(
    results: Results, tables: Sequence[Table], drawings: Sequence[Drawing], formats: Sequence[str]
) -> list[Path]:
    written: list[Path] = []
    target = results.folder / EXPORTS
    if formats:
        target.mkdir(exist_ok=True)
    for kind in dict.fromkeys(formats):
        if kind in ("png", "pdf", "svg"):
            metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
            for drawing in drawings:
                path = target / f"{drawing.name}.{kind}"
                drawing.figure.savefig(path, format=kind, dpi=PNG_DPI, metadata=metadata)
                written.append(path)
        elif kind == "parquet":
            written += _parquet_writer()(results, target)
        else:
            for table in tables:
                path = target / f"{table.name}.{'tex' if kind == 'latex' else 'csv'}"
                text = table.to_latex() if kind == "latex" else table.to_csv()
                path.write_text(text, encoding="utf-8")
                written.append(path)
    return written


def _parquet_writer() -> Callable[[Results, Path], list[Path]]:
    try:
        from drone_mesh.lab.parquet import write_parquet
    except ImportError as error:
        what = f"--export parquet needs the Python package {error.name}"
        raise ReportError(f"{what}: pip install 'drone_mesh[parquet]'") from None
    return write_parquet


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
