"""The results folder: a database records what is done; the CSV files are its exports."""

from __future__ import annotations

import contextlib
import csv
import fcntl
import itertools
import json
import os
import shutil
import sqlite3
from pathlib import Path
from typing import Any, Iterable, Iterator, Mapping, Sequence

from drone_mesh.errors import MeshError
from drone_mesh.lab.plan import Plan, flatten
from drone_mesh.lab.terminal import PROGRAM
from drone_mesh.lab.worker import Outcome, as_cell, metric_columns

FIRST_COLUMNS = ("run", "seed", "repetition")
LAST_COLUMNS = ("event_hash", "code", "wall_s")
OUTAGE_COLUMNS = ("run", "repetition", "node", "lost_s", "restored_s")
FAILURE_COLUMNS = ("run", "repetition", "cell", "kind", "message", "command", "traceback")
DATABASE = "runs.sqlite"
RUNS, OUTAGES, FAILURES, PLAN = "runs.csv", "outages.csv", "failures.csv", "plan.csv"
PROVENANCE, EXPERIMENT = "provenance.json", "experiment.yaml"

# A row is a JSON object, and one statement writes a run with its outages.
_TABLES = """
BEGIN;
CREATE TABLE IF NOT EXISTS plan (place INTEGER PRIMARY KEY, run TEXT UNIQUE, cell INTEGER);
CREATE TABLE IF NOT EXISTS runs (run TEXT PRIMARY KEY, code TEXT, row TEXT, outages TEXT);
CREATE TABLE IF NOT EXISTS failures (run TEXT PRIMARY KEY, row TEXT);
COMMIT;
"""
_RUNS, _FAILURES = "SELECT runs.row FROM runs", "SELECT failures.row FROM failures"
_OUTAGES = "SELECT outages FROM runs"
_IN_ORDER = "LEFT JOIN plan USING (run) ORDER BY place IS NULL, place, run"  # then earlier plans

_MIXED = "SELECT cell FROM plan JOIN runs USING (run) GROUP BY cell HAVING min(code) != max(code)"


class StoreError(MeshError):
    """The results folder cannot be used. The message gives the reason and the remedy."""


class Store:
    """One results folder, open for writing by this process alone."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        """Raises StoreError if it is not writable, or another `lab run` is writing to it."""
        self.folder = folder
        self._plan = plan
        _refuse_csv_alone(folder)
        with _explained("use", folder):
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / ".lock").open("a+", encoding="utf-8")
        self._take_lock()
        with _explained("use", folder / DATABASE):
            self._database = sqlite3.connect(str(folder / DATABASE), isolation_level=None)
            self._database.executescript(_TABLES)
            # With a log, a row costs no wait for the disk, and a killed writer loses none.
            self._database.execute("PRAGMA journal_mode = WAL")
            self._database.execute("PRAGMA synchronous = NORMAL")
            self.codes = dict(self._database.execute("SELECT run, code FROM runs"))
            self.failed = {run for (run,) in self._database.execute("SELECT run FROM failures")}

    def _take_lock(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._lock.seek(0)
            holder = self._lock.read().strip() or "another process"
            self._lock.close()
            raise StoreError(
                f"{self.folder}: {holder} is writing there; wait for it, or choose another --out"
            ) from None
        except OSError as error:  # as on NFS without its lock service
            self._lock.close()
            raise StoreError(
                f"cannot lock {self.folder}: {error.strerror}; choose another --out"
            ) from error
        self._lock.truncate(0)
        self._lock.write(f"lab run, process {os.getpid()} on {os.uname().nodename},")
        self._lock.flush()

    def use(self, plan: Plan) -> None:
        """Continue with another plan of the same experiment, with more seeds."""
        self._plan = plan
        rows = ((place, one.spec.run, one.cell) for place, one in enumerate(plan))
        with self._at_once():
            self._database.execute("DELETE FROM plan")
            self._database.executemany("INSERT OR IGNORE INTO plan VALUES (?, ?, ?)", rows)

    def describe(self, sessions: Sequence[Mapping[str, Any]]) -> None:
        """Write down the file as given, the plan, and these sessions after the earlier ones."""
        path = self._plan.loaded.path
        earlier = read_provenance(self.folder)
        with _explained("write", self.folder):
            if path.resolve() != (self.folder / EXPERIMENT).resolve():
                shutil.copyfile(path, self.folder / EXPERIMENT)
            text = json.dumps([*earlier, *sessions], indent=2) + "\n"
            (self.folder / PROVENANCE).write_text(text, encoding="utf-8")
        self.use(self._plan)

    def add(self, outcome: Outcome, cell: str, command: str) -> None:
        """Store the outcome of a run: its row and its outages, or its failure."""
        spec = outcome.spec
        names = {"run": spec.run, "repetition": str(spec.repetition)}
        if outcome.failure:
            what = (cell, outcome.failure, outcome.message, command, outcome.traceback)
            row = {**names, **dict(zip(FAILURE_COLUMNS[len(names) :], what))}
            self._insert("failures", spec.run, json.dumps(row))
            self.failed.add(spec.run)
            return
        if spec.run in self.codes:  # a worker presumed dead had finished it
            return
        row = {
            **names,
            "seed": str(spec.seed),
            **flatten(json.loads(spec.scenario)),
            **{name: as_cell(value) for name, value in outcome.values.items()},
            "event_hash": outcome.event_hash,
            "code": outcome.code,
            "wall_s": f"{outcome.wall_s:.4f}",
        }
        outages = [
            {
                **names,
                "node": outage.node,
                "lost_s": as_cell(outage.lost_s),
                "restored_s": "" if outage.restored_s is None else as_cell(outage.restored_s),
            }
            for outage in outcome.outages
        ]
        self._insert("runs", spec.run, outcome.code, json.dumps(row), json.dumps(outages))
        self.codes[spec.run] = outcome.code

    def _insert(self, table: str, *values: str) -> None:
        with _explained("write", self.folder / DATABASE):
            places = ", ".join("?" * len(values))
            self._database.execute(f"INSERT OR REPLACE INTO {table} VALUES ({places})", values)

    def take_from(self, others: Sequence[Path]) -> int:
        """Copy the runs of other results folders that this one lacks; returns how many.

        Raises StoreError, and copies none, if two have one run from different code.
        """
        before = len(self.codes)
        codes = dict(self.codes)
        with self._at_once():
            for other in others:
                with _reading(other) as database:
                    for row in database.execute("SELECT run, code, row, outages FROM runs"):
                        if codes.setdefault(row[0], row[1]) != row[1]:
                            raise StoreError(
                                f"{other}: run {row[0]} is of code {row[1]}, and there is one of "
                                f"code {codes[row[0]]}: merge shards of the same code"
                            )
                        self._insert("runs", *row)
                    for row in database.execute("SELECT run, row FROM failures"):
                        self._insert("failures", *row)
            self._database.execute("DELETE FROM failures WHERE run IN (SELECT run FROM runs)")
        self.codes = codes
        return len(codes) - before

    def forget(self, runs: Iterable[str]) -> None:
        """Remove finished runs, so that they count as missing."""
        for run in list(runs):
            with _explained("write", self.folder / DATABASE):
                self._database.execute("DELETE FROM runs WHERE run = ?", (run,))
            del self.codes[run]

    def forget_failures(self) -> None:
        """Remove failed runs, so that they count as missing."""
        with _explained("write", self.folder / DATABASE):
            self._database.execute("DELETE FROM failures")
        self.failed = set()

    @contextlib.contextmanager
    def _at_once(self) -> Iterator[None]:
        """All that is written inside, or nothing."""
        with _explained("write", self.folder / DATABASE):
            self._database.execute("BEGIN")
            with self._database:
                yield

    def export(self) -> None:
        """Write the CSV files in the order of the plan: the same runs give the same bytes."""
        plan, database = self._plan, self._database
        columns = [*FIRST_COLUMNS, *plan.parameter_columns, *metric_columns(plan.own_metrics)]
        columns = list(dict.fromkeys([*columns, *LAST_COLUMNS, *_columns(database)]))
        for name, header, rows in (
            (RUNS, columns, _rows(database, _RUNS)),
            (OUTAGES, OUTAGE_COLUMNS, _each_outage(database)),
            (FAILURES, FAILURE_COLUMNS, _rows(database, _FAILURES)),
            (PLAN, ("run", "repetition", *plan.loaded.axes), map(plan.row, plan)),
        ):
            new = (self.folder / name).with_suffix(".new")
            with _explained("write", self.folder / name):
                with new.open("w", encoding="utf-8", newline="") as file:
                    writer = csv.DictWriter(file, header, lineterminator="\n", restval="")
                    writer.writeheader()
                    writer.writerows(rows)
                os.replace(new, self.folder / name)

    def close(self) -> None:
        """Release the folder for other writers."""
        with contextlib.suppress(sqlite3.Error):  # a reader in between; the next writer does it
            self._database.execute("PRAGMA journal_mode = DELETE")  # one file, also read-only
        self._database.close()
        self._lock.truncate(0)
        self._lock.close()


def read_runs(folder: Path) -> dict[str, dict[str, str]]:
    """The rows of all finished runs by id, with the same columns each. Raises StoreError."""
    with _reading(folder) as database:
        rows = list(_rows(database, _RUNS))
    empty = dict.fromkeys(itertools.chain.from_iterable(rows), "")
    return {row["run"]: {**empty, **row} for row in rows}


def read_outages(folder: Path) -> list[dict[str, str]]:
    """The rows of all outages of all finished runs. Raises StoreError."""
    with _reading(folder) as database:
        return list(_each_outage(database))


def read_failures(folder: Path) -> list[dict[str, str]]:
    """The rows of all failed runs. Raises StoreError."""
    with _reading(folder) as database:
        return list(_rows(database, _FAILURES))


def read_provenance(folder: Path) -> list[dict[str, Any]]:
    """All sessions that wrote to this folder, oldest first."""
    try:
        sessions = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return sessions if isinstance(sessions, list) else []


def describe_folder(folder: Path) -> str:
    """A few lines of text. Raises StoreError if the folder has no results."""
    with _reading(folder) as database:

        def count(what: str) -> int:
            return int(database.execute(f"SELECT count(*) FROM {what}").fetchone()[0])

        planned, done, failed = count("plan"), count("runs"), count("failures")
        in_plan = count("plan JOIN runs USING (run)")
        found = database.execute("SELECT DISTINCT code FROM runs")
        codes = sorted({code.partition(" ")[0] for (code,) in found})
        mixed = database.execute(_MIXED).fetchall()
    lines = [f"{folder}: {in_plan} of {planned} runs done"]
    if failed:
        lines[0] += f", {failed} failed"
    if done > in_plan:
        lines.append(f"{done - in_plan} more runs are of an earlier plan and are kept")
    if len(codes) > 1:
        lines.append(f"warning: rows of {len(codes)} versions of the code: {', '.join(codes)}")
    elif codes and "+dirty" in codes[0]:
        lines.append(f"warning: run with uncommitted changes ({codes[0]})")
    if mixed:
        lines.append(
            f"warning: cells of mixed code: {len(mixed)}; `{PROGRAM} run` with --again repeats the "
            "older runs"
        )
    sessions = read_provenance(folder)
    if sessions:
        last = sessions[-1]
        lines.append(f"last session: {last['started']}, {' '.join(last['command'])}")
    return "\n".join(lines)


def _rows(database: sqlite3.Connection, query: str) -> Iterator[Any]:
    return (json.loads(row) for (row,) in database.execute(f"{query} {_IN_ORDER}"))


def _each_outage(database: sqlite3.Connection) -> Iterator[Any]:
    return itertools.chain.from_iterable(_rows(database, _OUTAGES))


def _columns(database: sqlite3.Connection) -> list[str]:
    """All columns of any run, in order of first appearance."""
    return list(dict.fromkeys(itertools.chain.from_iterable(_rows(database, _RUNS))))


@contextlib.contextmanager
def _reading(folder: Path) -> Iterator[sqlite3.Connection]:
    _refuse_csv_alone(folder)
    path = folder / DATABASE
    if not path.exists() or not path.stat().st_size:  # empty: another process is just making it
        raise StoreError(f"{folder}: no {DATABASE} there, so it is not a results folder of the lab")
    with _explained("read", path):
        database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        with contextlib.closing(database):
            yield database


def _refuse_csv_alone(folder: Path) -> None:
    if (folder / RUNS).exists() and not (folder / DATABASE).exists():
        raise StoreError(
            f"{folder}: {RUNS} without {DATABASE}, of an earlier version of the lab: run the "
            "experiment again into another folder"
        )


@contextlib.contextmanager
def _explained(do: str, path: Path) -> Iterator[None]:
    """Raise StoreError for what the system or the database says."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise StoreError(
            f"cannot {do} {path}: {reason}; what was written before is kept"
        ) from error
