"""The results folder: its tables record what is done; no row is lost or repeated."""

from __future__ import annotations

import csv
import fcntl
import io
import json
import os
import shutil
from pathlib import Path
from typing import Any, Iterable, Mapping, Sequence

from drone_mesh.errors import MeshError
from drone_mesh.lab.experiment import as_text
from drone_mesh.lab.plan import Plan, flatten
from drone_mesh.lab.worker import Outcome, as_cell, metric_columns

FIRST_COLUMNS = ("run", "seed", "repetition")
LAST_COLUMNS = ("event_hash", "code", "wall_s")
OUTAGE_COLUMNS = ("run", "repetition", "node", "lost_s", "restored_s")
FAILURE_COLUMNS = ("run", "repetition", "cell", "kind", "message", "command", "traceback")
RUNS, OUTAGES, FAILURES = "runs.csv", "outages.csv", "failures.csv"
PLAN, PROVENANCE, EXPERIMENT, LOGS = "plan.csv", "provenance.json", "experiment.yaml", "logs"


class StoreError(MeshError):
    """The results folder cannot be used. The message gives the reason and the remedy."""


class CsvLog:
    """An append-only CSV file whose rows are either complete or absent."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Repair the file of a killed writer: remove an incomplete last line."""
        self.path = path
        self.columns = list(columns)
        self.rows = read_rows(path)
        there = list(self.rows[0]) if self.rows else []
        self.columns += [name for name in there if name not in self.columns]
        self.rewrite(self.rows)

    def append(self, rows: Iterable[Mapping[str, str]]) -> None:
        """Write these rows, all or none. Raises StoreError if writing fails."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns, lineterminator="\n", restval="")
        writer.writerows(rows)
        data = text.getvalue().encode()
        end = os.fstat(self._file).st_size
        try:
            view = memoryview(data)
            while view:
                view = view[os.write(self._file, view) :]
        except OSError as error:
            os.ftruncate(self._file, end)
            raise _cannot("write", self.path, error) from error

    def rewrite(self, rows: Iterable[Mapping[str, str]]) -> None:
        """Replace the file by these rows atomically, and append after them from now on."""
        new = self.path.with_suffix(".new")
        try:
            with new.open("w", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, self.columns, lineterminator="\n", restval="")
                writer.writeheader()
                writer.writerows(rows)
                file.flush()
                os.fsync(file.fileno())
            os.replace(new, self.path)
            self.close()
            self._file = os.open(self.path, os.O_WRONLY | os.O_APPEND)
        except OSError as error:
            raise _cannot("write", self.path, error) from error

    def close(self) -> None:
        """Close the file."""
        if hasattr(self, "_file"):
            os.close(self._file)
            del self._file


class Store:
    """One results folder, open for writing by this process alone."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        """Raises StoreError if it is not writable, or another `lab run` is writing to it."""
        self.folder = folder
        self._plan = plan
        try:
            (folder / LOGS).mkdir(parents=True, exist_ok=True)
            self._lock = (folder / ".lock").open("a+", encoding="utf-8")
        except OSError as error:
            raise _cannot("use", folder, error) from error
        self._take_lock()
        own = plan.own_metrics
        columns = [*FIRST_COLUMNS, *plan.parameter_columns, *metric_columns(own), *LAST_COLUMNS]
        self.runs = CsvLog(folder / RUNS, columns)
        self.outages = CsvLog(folder / OUTAGES, OUTAGE_COLUMNS)
        self.failures = CsvLog(folder / FAILURES, FAILURE_COLUMNS)
        self.done = {row["run"] for row in self.runs.rows}
        self.failed = {row["run"] for row in self.failures.rows}
        self._drop_orphans()

    def _take_lock(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.seek(0)
            holder = self._lock.read().strip() or "another process"
            self._lock.close()
            raise StoreError(
                f"{self.folder}: {holder} is writing there; wait for it, or choose another --out"
            ) from None
        self._lock.truncate(0)
        self._lock.write(f"lab run, process {os.getpid()} on {os.uname().nodename},")
        self._lock.flush()

    def _drop_orphans(self) -> None:
        """Remove outages of runs that are not in runs.csv, left by a writer killed in between."""
        kept = [row for row in self.outages.rows if row["run"] in self.done]
        if len(kept) != len(self.outages.rows):
            self.outages.rewrite(kept)

    def use(self, plan: Plan) -> None:
        """Continue with another plan of the same experiment, with more seeds."""
        self._plan = plan
        self._write_plan()

    def describe(self, session: Mapping[str, Any]) -> None:
        """Write down the session: the file as given, the plan, and this session."""
        loaded = self._plan.loaded
        sessions = read_provenance(self.folder)
        try:
            if loaded.path.resolve() != (self.folder / EXPERIMENT).resolve():
                shutil.copyfile(loaded.path, self.folder / EXPERIMENT)
            text = json.dumps([*sessions, dict(session)], indent=2) + "\n"
            (self.folder / PROVENANCE).write_text(text, encoding="utf-8")
        except OSError as error:
            raise _cannot("write", self.folder, error) from error
        self._write_plan()

    def _write_plan(self) -> None:
        path = self.folder / PLAN
        try:
            with path.open("w", encoding="utf-8", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(["run", "repetition", *self._plan.loaded.axes])
                for planned in self._plan:
                    values = self._plan.cells[planned.cell].values.values()
                    cells = [planned.spec.run, planned.spec.repetition, *map(as_text, values)]
                    writer.writerow(cells)
        except OSError as error:
            raise _cannot("write", path, error) from error

    def add(self, outcome: Outcome, cell: str, command: str) -> None:
        """Store the outcome of a run: its row and its outages, or its failure."""
        spec = outcome.spec
        if outcome.failure:
            self._add_failure(outcome, cell, command)
            return
        if spec.run in self.done:  # a worker presumed dead had finished it
            return
        if self._plan.loaded.experiment.output == "runs_and_outages":
            self.outages.append(
                {
                    "run": spec.run,
                    "repetition": str(spec.repetition),
                    "node": str(outage.node),
                    "lost_s": as_cell(outage.lost_s),
                    "restored_s": "" if outage.restored_s is None else as_cell(outage.restored_s),
                }
                for outage in outcome.outages
            )
        row = {
            "run": spec.run,
            "seed": str(spec.seed),
            "repetition": str(spec.repetition),
            **flatten(json.loads(spec.scenario)),
            **{name: as_cell(value) for name, value in outcome.values.items()},
            "event_hash": outcome.event_hash,
            "code": outcome.code,
            "wall_s": f"{outcome.wall_s:.4f}",
        }
        self.runs.append([row])
        self.done.add(spec.run)

    def take_from(self, other: Path) -> int:
        """Copy the rows of another results folder that this one lacks; returns how many runs."""
        rows = [row for row in read_rows(other / RUNS) if row["run"] not in self.done]
        new = {row["run"] for row in rows}
        self.outages.append(row for row in read_rows(other / OUTAGES) if row["run"] in new)
        self.runs.append(rows)
        self.done |= new
        failures = read_rows(other / FAILURES)
        self.failures.append(row for row in failures if row["run"] not in self.failed | self.done)
        return len(new)

    def _add_failure(self, outcome: Outcome, cell: str, command: str) -> None:
        spec = outcome.spec
        row = {
            "run": spec.run,
            "repetition": str(spec.repetition),
            "cell": cell,
            "kind": outcome.failure,
            "message": outcome.message,
            "command": command,
            "traceback": outcome.traceback,
        }
        self.failures.append([row])
        self.failed.add(spec.run)
        try:
            (self.folder / LOGS / f"{spec.run}.txt").write_text(
                f"{command}\n{outcome.message}\n\n{outcome.traceback}", encoding="utf-8"
            )
        except OSError as error:
            raise _cannot("write", self.folder / LOGS, error) from error

    def forget_failures(self) -> None:
        """Remove failed runs, so that they count as missing."""
        self.failures.rewrite([])
        self.failed = set()

    def put_in_order(self) -> None:
        """Sort all tables in the order of the plan: the same runs produce the same bytes."""
        order = {planned.spec.run: place for place, planned in enumerate(self._plan)}
        for table in (self.runs, self.outages, self.failures):
            rows = read_rows(table.path)
            table.rewrite(sorted(rows, key=lambda row: order.get(row["run"], len(order))))

    def close(self) -> None:
        """Release the folder for other writers."""
        for table in (self.runs, self.outages, self.failures):
            table.close()
        self._lock.truncate(0)
        self._lock.close()


def read_rows(path: Path) -> list[dict[str, str]]:
    """The complete rows of a CSV file; none if it does not exist. Omits an incomplete last row.

    Raises StoreError for a file that cannot be read.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise _cannot("read", path, error) from error
    text = data[: data.rfind(b"\n") + 1].decode("utf-8-sig", "replace")
    try:
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
    except csv.Error as error:
        raise StoreError(f"{path}: {error}") from error
    if rows and "run" not in rows[0]:
        raise StoreError(f"{path}: has no column run")
    while rows and None in rows[-1].values():
        rows.pop()  # cut off inside a quoted traceback
    return rows


def read_provenance(folder: Path) -> list[dict[str, Any]]:
    """All sessions that wrote to this folder, oldest first."""
    try:
        sessions = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return sessions if isinstance(sessions, list) else []


def describe_folder(folder: Path) -> str:
    """A few lines of text. Raises StoreError if the folder has no results."""
    if not (folder / PLAN).exists():
        raise StoreError(f"{folder}: no {PLAN} there, so it is not a results folder of lab run")
    planned = [row["run"] for row in read_rows(folder / PLAN)]
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


def _cannot(do: str, path: Path, error: OSError) -> StoreError:
    return StoreError(
        f"cannot {do} {path}: {error.strerror or error}; what was written before is kept"
    )
