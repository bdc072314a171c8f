"""Runs and outages as Parquet files: columns with types, for pandas, DuckDB, R and others."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Mapping, Sequence

import pyarrow as pa
from pyarrow import csv as arrow_csv
from pyarrow import parquet

from drone_mesh.lab.results import Results
from drone_mesh.lab.store import OUTAGE_COLUMNS, read_outages
from drone_mesh.lab.worker import metric_columns

_TEXT = ("run", "event_hash", "code")  # a hash may look like a number
_OUTAGES = dict(zip(OUTAGE_COLUMNS, (pa.string(), pa.int64(), pa.int64(), *[pa.float64()] * 2)))


def write_parquet(results: Results, target: Path) -> list[Path]:
    """Write what runs.csv and outages.csv hold; a value that is undefined is null."""
    runs = list(results.rows.values())
    metrics = metric_columns(results.plan[0].spec.own_metrics)
    types = {**dict.fromkeys(metrics, pa.float64()), **dict.fromkeys(_TEXT, pa.string())}
    written = []
    for name, rows, columns, of in (
        ("runs", runs, list(runs[0]), types),
        ("outages", read_outages(results.folder), OUTAGE_COLUMNS, _OUTAGES),
    ):
        path = target / f"{name}.parquet"
        parquet.write_table(_table(rows, columns, of), path)
        written.append(path)
    return written


def _table(
    rows: Sequence[Mapping[str, str]], columns: Sequence[str], types: Mapping[str, pa.DataType]
) -> pa.Table:
    """The types of the other columns, which are parameters, follow from all of their values."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns)
    writer.writeheader()
    writer.writerows(rows)
    options = arrow_csv.ConvertOptions(column_types=types)
    return arrow_csv.read_csv(pa.py_buffer(text.getvalue().encode()), convert_options=options)
