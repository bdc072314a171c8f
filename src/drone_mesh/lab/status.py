"""The progress of a results folder."""

from __future__ import annotations

import csv
from pathlib import Path

from drone_mesh.lab.store import FAILURES, PLAN, RUNS, StoreError, read_provenance, read_rows


def describe_folder(folder: Path) -> str:
    """A few lines of text. Raises StoreError if the folder has no results."""
    if not (folder / PLAN).exists():
        raise StoreError(f"{folder}: no {PLAN} there, so it is not a results folder of lab run")
    with (folder / PLAN).open(encoding="utf-8", newline="") as file:
        planned = [row["run"] for row in csv.DictReader(file)]
    rows = read_rows(folder / RUNS)
    done = {row["run"] for row in rows}
    failed = {row["run"] for row in read_rows(folder / FAILURES)} - done
    in_plan = sum(run in done for run in planned)
    lines = [f"{folder}: {in_plan} of {len(planned)} runs done"]
    if failed:
        lines[0] += f", {len(failed)} failed"
    if len(done) > in_plan:
        lines.append(f"{len(done) - in_plan} more runs are of an earlier plan and are kept")
    codes = sorted({row["code"] for row in rows})
    if len(codes) > 1:
        lines.append(f"warning: rows of {len(codes)} versions of the code: {', '.join(codes)}")
    elif codes and codes[0].endswith("+dirty"):
        lines.append(f"warning: run with uncommitted changes ({codes[0]})")
    sessions = read_provenance(folder)
    if sessions:
        last = sessions[-1]
        lines.append(f"last session: {last['started']}, {' '.join(last['command'])}")
    return "\n".join(lines)
