"""The results folder and the workers: nothing lost, nothing twice, the same bytes every way."""

from __future__ import annotations

import contextlib
import csv
import errno
import fcntl
import json
import math
import os
import resource
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Callable, Iterator

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.campaign import _is_narrow
from drone_mesh.lab.command import main
from drone_mesh.lab.engine import EngineError, _introduce_package, run_all
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.store import Store, StoreError, read_runs
from drone_mesh.lab.worker import execute

ROOT = Path(__file__).resolve().parents[3]
SMALL = """\
name: small
seeds: 4
base:
  layout: {kind: line, drones: 3}
  duration_s: 20
  faults: [{at_s: 12, kill: {number: 1}}]
sweep: {radio.loss: [0, 0.2]}
"""
OWN = """\
import os, signal, time

def boom(record):
    raise ValueError("no good")

def nothing(record):
    pass

def drones(record):
    return float(len(record.start.places))

def endless(record):
    while True:
        pass

def slow(record):
    time.sleep(0.1)
    return 1.0

def deadly(record):
    drones, marker = len(record.start.places), os.environ["LAB_TEST_MARKER"]
    if drones == 3 and not os.path.exists(marker):
        open(marker, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    if drones == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return 1.0
"""


@pytest.fixture
def experiment(tmp_path: Path) -> Callable[..., Path]:
    (tmp_path / "own_lab_parts.py").write_text(OWN)

    def write(added: str = "", text: str = SMALL) -> Path:
        path = tmp_path / "small.yaml"
        path.write_text(text + added)
        return path

    return write


def lab(*words: object) -> int:
    return main([str(word) for word in words])


def run(path: Path, out: Path, *words: object) -> int:
    return lab("run", path, "--out", out, "--workers", 0, *words)


def read_rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def measured(folder: Path) -> bytes:
    """runs.csv without its last column, the wall time."""
    lines = (folder / "runs.csv").read_bytes().splitlines()
    return b"\n".join(line.rpartition(b",")[0] for line in lines)


def test_a_run_gives_one_tidy_row_per_run_in_the_order_of_the_plan(
    experiment: Callable[..., Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert run(experiment(), out) == 0
    rows = read_rows(out / "runs.csv")
    plan = list(csv.DictReader((out / "plan.csv").open()))
    assert [row["run"] for row in rows] == [row["run"] for row in plan]
    assert [(row["repetition"], row["radio.loss"]) for row in rows[:3]] == [
        ("0", "0.0"), ("0", "0.2"), ("1", "0.0"),
    ]  # fmt: skip
    assert rows[0]["faults.0.kill.number"] == "1"
    assert rows[0]["victims"] == "1"
    assert (out / "experiment.yaml").read_text() == SMALL
    assert {path.name for path in out.iterdir()} == {
        ".lock", "experiment.yaml", "failures.csv", "outages.csv", "plan.csv",
        "provenance.json", "runs.csv", "runs.sqlite",
    }  # fmt: skip


@pytest.mark.slow
def test_a_second_run_does_only_what_is_missing(
    experiment: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    path = experiment()
    run(path, out, "seeds=2")
    done: list[str] = []

    def counted(spec: Any) -> Any:
        done.append(spec.run)
        return execute(spec)

    monkeypatch.setattr("drone_mesh.lab.engine.execute", counted)
    run(path, out)
    assert len(done) == 4  # two more seeds of two cells
    run(path, out, "sweep.radio.loss=[0, 0.1, 0.2]")
    assert len(done) == 8
    run(path, out)
    assert len(done) == 8


@pytest.mark.slow
def test_rows_are_the_same_bytes_with_and_without_interruption(
    experiment: Callable[..., Path], tmp_path: Path
) -> None:
    path = experiment()
    run(path, tmp_path / "whole")
    out = tmp_path / "parts"
    run(path, out, "seeds=1")
    (out / "runs.csv").write_text("an export is written anew")
    run(path, out)
    assert measured(out) == measured(tmp_path / "whole")
    assert (out / "outages.csv").read_bytes() == (tmp_path / "whole/outages.csv").read_bytes()


@pytest.mark.slow
def test_shards_together_are_the_whole(experiment: Callable[..., Path], tmp_path: Path) -> None:
    path = experiment()
    run(path, tmp_path / "whole")
    shards = [tmp_path / f"shard{index}" for index in range(3)]
    for index, shard in enumerate(shards):
        run(path, shard, "--shard", f"{index}/3")
    sizes = [len(read_rows(shard / "runs.csv")) for shard in shards]
    assert sizes == [3, 3, 2]
    assert lab("merge", tmp_path / "all", *shards) == 0
    assert measured(tmp_path / "all") == measured(tmp_path / "whole")


def test_a_merge_refuses_one_run_of_two_codes_and_takes_none(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = experiment()
    for name in ("a", "b"):
        run(path, tmp_path / name, "seeds=1", "sweep.radio.loss=[0]")
    database = sqlite3.connect(str(tmp_path / "b/runs.sqlite"))
    with database:
        database.execute("UPDATE runs SET code = 'older'")
    database.close()
    capsys.readouterr()
    assert lab("merge", tmp_path / "all", tmp_path / "a", tmp_path / "b") == 1
    assert "is of code older, and there is one of code" in capsys.readouterr().err
    assert read_runs(tmp_path / "all") == {}


def test_results_that_are_csv_alone_are_refused_in_one_line_with_the_remedy(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(experiment(), tmp_path / "out", "seeds=1")
    (tmp_path / "out/runs.sqlite").unlink()
    before = (tmp_path / "out/runs.csv").read_bytes()
    capsys.readouterr()
    for words in (["run", experiment(), "--out"], ["status"], ["report"]):
        assert lab(*words, tmp_path / "out") == 1
        error = capsys.readouterr().err
        assert "runs.csv without runs.sqlite, of an earlier version of the lab: run the" in error
    assert (tmp_path / "out/runs.csv").read_bytes() == before


def test_a_store_that_is_damaged_is_refused_in_one_line(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(experiment(), tmp_path / "out", "seeds=1")
    (tmp_path / "out/runs.sqlite").write_bytes(b"run,seed\n" * 999)
    capsys.readouterr()
    assert lab("status", tmp_path / "out") == 1
    error = capsys.readouterr().err
    assert "runs.sqlite: file is not a database; what was written before is kept" in error


def test_a_shard_does_not_know_whether_all_runs_together_are_enough(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = experiment("stop: {metric: packets, half_width: 1000000}\n"), tmp_path / "out"
    assert run(path, out, "--shard", "0/2") == 1
    assert "--shard: `stop` needs the runs of all shards" in capsys.readouterr().err
    assert not out.exists()
    assert run(path, out, "stop=null", "--shard", "0/2") == 0
    assert len(read_rows(out / "runs.csv")) == 4


@pytest.mark.slow
def test_shards_of_different_experiments_are_not_merged(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(experiment(), tmp_path / "a", "seeds=1")
    run(experiment(), tmp_path / "b", "seeds=2")
    assert lab("merge", tmp_path / "all", tmp_path / "a", tmp_path / "b") == 1
    assert "different experiments" in capsys.readouterr().err


def test_a_failing_run_is_a_failure_with_traceback_and_command_and_the_others_continue(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SMALL.replace("[0, 0.2]", "[0]") + "metrics: ['own_lab_parts:boom']\n"
    out = tmp_path / "out"
    assert run(experiment(text=text), out) == 1
    failures = read_rows(out / "failures.csv")
    assert len(failures) == 4
    first = failures[0]
    assert (first["kind"], first["message"]) == ("exception", "ValueError: no good")
    assert 'raise ValueError("no good")' in first["traceback"]
    assert first["command"] == f"python3 -m drone_mesh.lab show {out} {first['run']}"
    printed = capsys.readouterr().out
    assert "4 failed" in printed
    assert "\nfailed: ValueError: no good\n" in printed
    assert run(experiment(text=text), out) == 0  # failures are not missing
    assert run(experiment(text=text), out, "--retry-failed") == 1


@pytest.mark.slow
def test_an_endless_run_is_a_timeout(experiment: Callable[..., Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    added = "metrics: ['own_lab_parts:endless']\ntimeout_s: 0.5\n"
    run(experiment(added), out, "seeds=1", "sweep.radio.loss=[0]")
    (failure,) = read_rows(out / "failures.csv")
    assert failure["kind"] == "timeout"
    assert failure["message"] == "still running after 0.5 s of wall time"


def test_a_metric_without_a_number_is_named(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(experiment("metrics: ['own_lab_parts:nothing']\n"), tmp_path / "out", "seeds=1")
    words = "metric own_lab_parts:nothing returned None, not a number"
    assert f"failed: ConfigurationError: {words}" in capsys.readouterr().out
    (failure,) = read_rows(tmp_path / "out/failures.csv")[:1]
    assert lab("show", tmp_path / "out", failure["run"]) == 1  # the command that repeats it
    assert f"lab: {words}" in capsys.readouterr().err


def test_a_metric_of_the_users_is_a_column(experiment: Callable[..., Path], tmp_path: Path) -> None:
    run(experiment("metrics: ['own_lab_parts:drones']\n"), tmp_path / "out", "seeds=1")
    assert {row["drones"] for row in read_rows(tmp_path / "out/runs.csv")} == {"3"}


@pytest.mark.slow
def test_seeds_are_added_until_the_interval_is_narrow(
    experiment: Callable[..., Path], tmp_path: Path
) -> None:
    stop = "stop: {metric: packets, relative_half_width: 0.00001, max_seeds: 10}\n"
    run(experiment(stop), tmp_path / "never", "sweep.radio.loss=[0.2]")
    assert len(read_rows(tmp_path / "never/runs.csv")) == 10
    stop = "stop: {metric: packets, relative_half_width: 0.9, max_seeds: 10}\n"
    run(experiment(stop), tmp_path / "soon", "sweep.radio.loss=[0.2]")
    assert len(read_rows(tmp_path / "soon/runs.csv")) == 4


def test_two_runs_in_one_folder_are_refused(
    experiment: Callable[..., Path], tmp_path: Path
) -> None:
    plan = Plan(load_experiment(experiment()))
    first = Store(tmp_path / "out", plan)
    with pytest.raises(StoreError, match=f"process {os.getpid()} on .* is writing there"):
        Store(tmp_path / "out", plan)
    first.close()
    Store(tmp_path / "out", plan).close()


def test_a_file_system_without_locks_is_named_and_no_other_process_is_waited_for(
    experiment: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(_file: object, _how: int) -> None:  # NFS without its lock service
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    reason = f"^cannot lock {tmp_path / 'out'}: No locks available; "
    with pytest.raises(StoreError, match=reason):
        Store(tmp_path / "out", Plan(load_experiment(experiment())))


def test_a_folder_that_cannot_be_made_is_refused_before_anything_runs(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert run(experiment(), tmp_path / "file" / "out") == 1
    assert "Not a directory; what was written before is kept" in capsys.readouterr().err


def test_a_bad_experiment_writes_nothing(experiment: Callable[..., Path], tmp_path: Path) -> None:
    assert run(experiment("seds: 3\n"), tmp_path / "out") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_full_disk_ends_the_run_and_loses_nothing(
    experiment: Callable[..., Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A limit on the size of files stands for the disk: a write fails in the same way."""
    path, out = experiment(), tmp_path / "out"
    run(path, tmp_path / "whole")
    size = 80_000  # an empty database and its log take half of it

    def small_disk() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    command = [sys.executable, "-m", "drone_mesh.lab", "run", path, "--out", out, "--workers", "0"]
    done = subprocess.run(
        list(map(str, command)), preexec_fn=small_disk, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert done.returncode == 1
    assert f"cannot write {out / 'runs.sqlite'}: " in done.stderr
    assert "continue with: python3 -m drone_mesh.lab run" in done.stderr
    assert "Traceback" not in done.stderr
    kept = read_runs(out)
    assert 0 < len(kept) < 8
    run(path, out)
    assert measured(out) == measured(tmp_path / "whole")


# Workers -----------------------------------------------------------------------------------------


def start(path: Path, out: Path, *words: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "drone_mesh.lab", "run", str(path), "--out", str(out), *words],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), **environment},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip


def finish(process: subprocess.Popen[str]) -> str:
    output, _ = process.communicate()
    return output


def wait_for_rows(out: Path, number: int, process: subprocess.Popen[str]) -> None:
    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        with contextlib.suppress(StoreError):  # there is none yet
            if len(read_runs(out)) >= number:
                return
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.05)
    raise AssertionError(f"fewer than {number} rows within 60 s")


def address_of(scheduler_file: Path) -> str:
    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        if scheduler_file.exists():
            text = scheduler_file.read_text()
            address = text.partition('"address": "')[2].partition('"')[0]
            if address:
                return address
        time.sleep(0.1)
    raise AssertionError("the scheduler wrote no address within 60 s")


@pytest.fixture
def slow(experiment: Callable[..., Path]) -> Path:
    """20 runs of a tenth of a second."""
    text = SMALL.replace("seeds: 4", "seeds: 10") + "metrics: ['own_lab_parts:slow']\n"
    return experiment(text=text)


@pytest.fixture
def slow_rows(slow: Path, tmp_path: Path) -> bytes:
    run(slow, tmp_path / "reference")
    return measured(tmp_path / "reference")


@pytest.mark.slow
def test_a_killed_client_loses_nothing(slow: Path, slow_rows: bytes, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = start(slow, out, "--workers", "1")
    wait_for_rows(out, 5, process)
    process.kill()
    process.wait()
    kept = len(read_runs(out))
    assert 5 <= kept < 20
    assert run(slow, out) == 0
    assert measured(out) == slow_rows


@pytest.mark.slow
def test_runs_that_kill_their_workers_lose_nothing_and_one_that_always_does_is_a_failure(
    experiment: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of three drones kills its worker the first time, that of four drones each time."""
    monkeypatch.setenv("LAB_TEST_MARKER", str(tmp_path / "marker"))
    path = experiment("metrics: ['own_lab_parts:deadly']\n")
    few = ("seeds=1", "sweep.radio.loss=[0]")
    process = start(
        path, tmp_path / "out", "--workers", "2", *few, "sweep.layout.drones=[3, 4, 5, 6, 7]"
    )
    output = finish(process)
    assert process.returncode == 1, output
    assert (tmp_path / "marker").exists()
    (failure,) = read_rows(tmp_path / "out/failures.csv")
    assert (failure["kind"], failure["cell"]) == ("worker died", "radio.loss=0 layout.drones=4")
    run(path, tmp_path / "reference", *few, "sweep.layout.drones=[3, 5, 6, 7]")
    assert measured(tmp_path / "out") == measured(tmp_path / "reference")


@pytest.mark.slow
def test_workers_that_are_gone_for_good_end_the_batch(
    slow: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """dask gives up a worker whose start takes too long."""
    from distributed.deploy.spec import SpecCluster

    monkeypatch.setattr("drone_mesh.lab.engine.WORKERLESS_S", 1.0)
    plan = Plan(load_experiment(slow))
    outcomes = run_all((planned.spec for planned in plan), 1, None)
    next(outcomes)
    (cluster,) = (one for one in SpecCluster._instances if one.status.name == "running")
    cluster.scale(0)
    with pytest.raises(EngineError, match="all workers are gone for 1 s"):
        list(outcomes)


@pytest.mark.slow
def test_a_killed_scheduler_loses_nothing(slow: Path, slow_rows: bytes, tmp_path: Path) -> None:
    """Scheduler and worker are processes of their own, as on a cluster, and know no package."""
    out = tmp_path / "out"
    address_file = tmp_path / "scheduler.json"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port",
         "0", "--no-dashboard", "--scheduler-file", str(address_file)], **quiet,
    )  # fmt: skip
    worker = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file",
         str(address_file), "--nthreads", "1", "--no-dashboard", "--no-nanny"], **quiet,
    )  # fmt: skip
    try:
        process = start(slow, out, "--cluster", address_of(address_file))
        wait_for_rows(out, 5, process)
        scheduler.kill()
        output = finish(process)
        assert process.returncode == 1, output
        assert "continue with: python3 -m drone_mesh.lab run" in output
    finally:
        for one in (scheduler, worker):
            one.kill()
            one.wait()
    assert run(slow, out) == 0
    assert measured(out) == slow_rows


def test_a_worker_without_the_package_is_named_with_its_error_and_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Elsewhere:
        def run_on_scheduler(self, function: Callable[[str], None], code: str) -> None:
            function(code.replace(str(ROOT / "src"), "/nowhere").replace("drone_mesh.", "no_mesh."))

    @contextlib.contextmanager
    def connected(*_to: object) -> Iterator[None]:
        yield _introduce_package(Elsewhere())  # type: ignore[arg-type]

    monkeypatch.setattr("drone_mesh.lab.engine._client", connected)
    with pytest.raises(EngineError, match=r"No module named 'no_mesh'\. Install .*PYTHONPATH="):
        list(run_all((), 1, "tcp://elsewhere:8786"))


SBATCH = """\
#!/bin/sh
job=$SLURM_STAND_IN/job.$$
cp "$1" "$job"
setsid sh "$job" >"$job.log" 2>&1 </dev/null &
echo "Submitted batch job $!" | tee "$job.submitted"
"""
SCANCEL = """\
#!/bin/sh
for job in "$@"; do kill -TERM "-$job"; echo "$job" >>"$SLURM_STAND_IN/cancelled"; done
"""


@pytest.fixture
def slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the jobs of a cluster that runs them all at once, on this machine."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    monkeypatch.setenv("SLURM_STAND_IN", str(folder))
    monkeypatch.setenv("DASK_JOBQUEUE__SLURM__CORES", "1")
    monkeypatch.setenv("DASK_JOBQUEUE__SLURM__MEMORY", "1GB")
    return folder


@pytest.mark.slow
def test_jobs_of_slurm_do_the_runs_and_are_cancelled_at_the_end(
    slow: Path, slow_rows: bytes, slurm: Path, tmp_path: Path
) -> None:
    process = start(slow, tmp_path / "out", "--cluster", "slurm", "--workers", "2")
    output = finish(process)
    assert process.returncode == 0, output
    assert measured(tmp_path / "out") == slow_rows
    submitted = {path.read_text().split()[-1] for path in slurm.glob("job.*.submitted")}
    assert len(submitted) == 2
    assert set((slurm / "cancelled").read_text().split()) == submitted


@pytest.mark.slow
def test_a_missing_part_of_slurm_gives_one_line(
    slow: Path,
    slurm: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("DASK_JOBQUEUE__SLURM__CORES")
    on_slurm = ("run", slow, "--out", tmp_path / "out", "--cluster", "slurm")
    assert lab(*on_slurm) == 1
    error = capsys.readouterr().err
    assert "lab: --cluster slurm: describe a job (cores, memory, queue, walltime) in" in error
    (slurm / "sbatch").unlink()
    assert lab(*on_slurm) == 1
    error = capsys.readouterr().err
    assert "lab: --cluster slurm: sbatch not found; use a machine that can submit jobs" in error


@pytest.mark.slow
def test_ctrl_c_keeps_everything_and_prints_how_to_continue(
    slow: Path, slow_rows: bytes, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    process = start(slow, out, "--workers", "2")
    wait_for_rows(out, 5, process)
    os.killpg(process.pid, signal.SIGINT)  # a terminal signals the whole group
    output = finish(process)
    assert process.returncode == 130, output
    assert "continue with: python3 -m drone_mesh.lab run" in output
    assert "Traceback" not in output
    assert run(slow, out) == 0
    assert measured(out) == slow_rows


def test_a_metric_that_is_infinite_in_one_run_asks_for_more_runs_and_ends_nothing() -> None:
    assert not _is_narrow([math.inf, 1.0], None, 0.1)
    assert not _is_narrow([math.inf, 1.0], 0.5, None)
    assert _is_narrow([1.0, 1.0], None, 0.1)


def test_a_results_folder_is_needed_to_repeat_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert lab("show", tmp_path, "abc") == 1
    assert "not a results folder" in capsys.readouterr().err


def test_show_repeats_exactly_that_run(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(experiment(), tmp_path / "out", "seeds=1")
    row = read_rows(tmp_path / "out/runs.csv")[1]
    capsys.readouterr()
    assert lab("show", tmp_path / "out", row["run"][:6]) == 0
    shown = capsys.readouterr().out
    assert f"event hash {row['event_hash']}: reproduces the run" in shown
    assert "fault: kill" in shown


def test_show_repeats_a_whole_sequence_of_faults(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text("name: x\nbase:\n  sequence: {drones: [8, 9]}\n  sample_s: 2\n")
    run(path, tmp_path / "out", "seeds=1")
    capsys.readouterr()
    assert lab("show", tmp_path / "out", read_rows(tmp_path / "out/runs.csv")[0]["run"]) == 0
    assert "reproduces the run" in capsys.readouterr().out


def test_show_says_why_the_run_differs(
    experiment: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(experiment(), tmp_path / "out", "seeds=1")
    row = read_rows(tmp_path / "out/runs.csv")[0]
    other = json.dumps({**row, "event_hash": "0", "code": "older"})
    database = sqlite3.connect(str(tmp_path / "out/runs.sqlite"))
    with database:
        database.execute("UPDATE runs SET row = ? WHERE run = ?", (other, row["run"]))
    database.close()
    assert lab("show", tmp_path / "out", row["run"]) == 1
    assert "the row was computed by code older" in capsys.readouterr().out


def test_an_unknown_run_is_named(experiment: Callable[..., Path], tmp_path: Path) -> None:
    run(experiment(), tmp_path / "out", "seeds=1")
    from drone_mesh.lab.results import load_results

    with pytest.raises(ConfigurationError, match="0 runs of the plan begin with zzz"):
        load_results(tmp_path / "out").find_run("zzz")
