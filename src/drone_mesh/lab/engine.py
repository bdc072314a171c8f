"""Runs a batch, in this process or on workers, and yields the outcome of each run.

The store records what is done; the engine keeps no state. dask.distributed reassigns the work of
dead workers, from a laptop (LocalCluster) to a laboratory's cluster, with one API.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import shutil
import signal
import statistics
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Iterable, Iterator

from drone_mesh.errors import MeshError
from drone_mesh.lab.plan import RunSpec
from drone_mesh.lab.worker import Outcome, execute, execute_batch
from drone_mesh.stopping import ignored

if TYPE_CHECKING:
    from distributed import Client, Future

BATCH_S = 0.5  # work sent to a worker at once, so that the scheduler's overhead is negligible
LARGEST_BATCH = 64
TASKS_PER_WORKER = 2  # one running, one waiting
DEATHS_ALLOWED = 2  # after one more death of its worker a run counts as failed
WORKERLESS_S = 120.0  # dask gives up a worker that does not start, on an overloaded machine
SLURM = "slurm"
_SOURCE = str(Path(__file__).resolve().parents[2])  # the folder from which this process imports us
_IMPORT = f"""
import sys
try:
    import {execute_batch.__module__}
except ImportError:
    sys.path.append({_SOURCE!r})
    import {execute_batch.__module__}
"""


class EngineError(MeshError):
    """No workers are available, or they have ended. Outcomes yielded before are kept."""


def run_all(specs: Iterable[RunSpec], workers: int, cluster: str | None) -> Iterator[Outcome]:
    """Yield the outcome of each of these runs, in order of completion.

    `workers`: 0 for this process; otherwise the number of local processes, or of jobs on a SLURM
    cluster. `cluster`: the address of a dask scheduler, or "slurm". Raises EngineError.
    """
    if workers == 0 and cluster is None:
        for spec in specs:
            yield execute(spec)
        return
    try:
        with _client(workers, cluster) as client:
            yield from _run_on(client, deque(specs))
    except ImportError as error:
        raise EngineError(
            f"the dask scheduler or a worker says: {error}. Install this version there "
            f"(pip install 'drone_mesh[lab]'), or start it with PYTHONPATH={_SOURCE} if it has that"
        ) from error


@contextlib.contextmanager
def _client(workers: int, cluster: str | None) -> Iterator[Client]:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise EngineError(
            f"{error}: pip install 'drone_mesh[lab]' installs it; --workers 0 does not need it"
        ) from error
    dask.config.set(
        {
            "distributed.scheduler.allowed-failures": DEATHS_ALLOWED,
            "distributed.comm.timeouts.connect": "10s",
            # Local workers are forks of one process that has imported dask already: as processes
            # that begin with nothing, each takes two seconds of a core until its first run.
            "distributed.worker.multiprocessing-method": "forkserver",
        }
    )
    with contextlib.ExitStack() as stack:
        try:
            if cluster is None:
                # A terminal sends Ctrl-C to the workers too. Only this process handles it.
                patience = {"distributed.scheduler.no-workers-timeout": f"{WORKERLESS_S} s"}
                with ignored(signal.SIGINT), dask.config.set(patience):
                    local = LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        processes=True,
                        dashboard_address=None,
                        memory_limit=None,
                        silence_logs=logging.CRITICAL,
                    )
                address = stack.enter_context(local)
            elif cluster == SLURM:
                address = stack.enter_context(_slurm(workers))
            else:
                address = cluster
            client = stack.enter_context(Client(address, set_as_default=False))
        except (OSError, ValueError, RuntimeError) as error:
            raise EngineError(f"no dask scheduler at {cluster or 'localhost'}: {error}") from error
        if cluster is not None:
            _introduce_package(client)
        yield client


def _introduce_package(client: Client) -> None:
    """Let a scheduler and workers that others started import the checkout, if it is there too.

    dask pickles a built-in function without this package, so that it runs where ours cannot.
    """
    client.run_on_scheduler(exec, _IMPORT)
    client.register_worker_callbacks(functools.partial(exec, _IMPORT))  # also of those to come


def _slurm(workers: int) -> contextlib.AbstractContextManager[object]:
    try:
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError as error:
        raise EngineError("--cluster slurm needs: pip install dask-jobqueue") from error
    if shutil.which("sbatch") is None:
        raise EngineError("--cluster slurm: sbatch not found; use a machine that can submit jobs")
    try:
        cluster = SLURMCluster()
    except ValueError as error:
        raise EngineError(
            "--cluster slurm: describe a job (cores, memory, queue, walltime) in "
            f"~/.config/dask/jobqueue.yaml: {str(error).splitlines()[0]}"
        ) from error
    cluster.scale(jobs=max(1, workers))
    started: contextlib.AbstractContextManager[object] = cluster
    return started


def _run_on(client: Client, waiting: deque[RunSpec]) -> Iterator[Outcome]:
    from distributed import CancelledError, KilledWorker, as_completed, scheduler
    from distributed.comm.core import CommClosedError

    no_worker = getattr(scheduler, "NoWorkerError", ())  # since distributed 2025
    under_way: dict[Future, list[RunSpec]] = {}
    done = as_completed(loop=client.loop)
    lengths_s: deque[float] = deque(maxlen=50)
    # Runs whose worker died too often, perhaps by another run that it had: they are repeated with
    # nothing beside them, and the one that then kills its worker is to blame.
    suspects: deque[RunSpec] = deque()
    tried_alone: set[str] = set()  # keys of their futures

    def start(batch: list[RunSpec]) -> Future:
        future = client.submit(execute_batch, batch, pure=False)
        under_way[future] = batch
        done.add(future)
        return future

    def submit() -> None:
        if suspects:
            if not under_way:
                tried_alone.add(start([suspects.popleft()]).key)
            return
        size = 1
        if lengths_s:
            size = int(BATCH_S / max(statistics.mean(lengths_s), 1e-6))
            size = max(1, min(LARGEST_BATCH, size))
        while waiting and len(under_way) < TASKS_PER_WORKER * max(1, len(client.nthreads())):
            start([waiting.popleft() for _ in range(min(size, len(waiting)))])

    submit()
    try:
        for future in done:
            batch = under_way.pop(future)
            try:
                outcomes = future.result()
            except KilledWorker as error:
                is_to_blame = future.key in tried_alone
                outcomes = [_died(batch[0], str(error))] if is_to_blame else []
                suspects.extend(() if is_to_blame else batch)
            except no_worker as error:
                raise EngineError(f"all workers are gone for {WORKERLESS_S:.0f} s") from error
            except (CancelledError, CommClosedError) as error:
                raise EngineError(f"the dask scheduler is gone ({type(error).__name__})") from error
            future.release()
            lengths_s.extend(outcome.wall_s for outcome in outcomes)
            yield from outcomes
            submit()
    except (OSError, TimeoutError) as error:
        raise EngineError(f"the dask scheduler is gone: {error}") from error
    except RuntimeError as error:
        raise EngineError(f"dask failed: {error.__cause__ or error}") from error


def _died(spec: RunSpec, message: str) -> Outcome:
    words = f"killed its worker {DEATHS_ALLOWED + 1} times"
    return Outcome(spec, 0.0, "", failure="worker died", message=words, traceback=message)
