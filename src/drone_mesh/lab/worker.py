"""Executes one run, in this process or on a worker of a cluster."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import json
import logging
import math
import threading
import time
import traceback
from typing import Iterator, Mapping, NamedTuple, Sequence

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import extensions
from drone_mesh.lab.metrics import METRICS, measure_all
from drone_mesh.lab.plan import RunSpec
from drone_mesh.lab.provenance import code_with, imported_code
from drone_mesh.lab.record import RunRecord, ServiceGap
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.sequence import SequenceRun
from drone_mesh.lab.simulation import Simulation


class Outcome(NamedTuple):
    """The outcome of one run."""

    spec: RunSpec
    wall_s: float
    code: str  # version of the code that ran it
    values: Mapping[str, float] = {}  # by metric; empty after a failure
    event_hash: str = ""
    outages: Sequence[ServiceGap] = ()
    failure: str = ""  # kind; empty: none
    message: str = ""
    traceback: str = ""


class RunTimeout(Exception):
    """A run exceeded its time limit."""


def execute_batch(specs: list[RunSpec]) -> list[Outcome]:
    return [execute(spec) for spec in specs]


def execute(spec: RunSpec) -> Outcome:
    """Execute a run. Never raises for an error of the run, which is part of the outcome."""
    started = time.perf_counter()
    try:
        with quiet_nodes(), _alarm(spec.timeout_s):
            values, event_hash, outages = _measure(spec)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a user's technique may raise anything, SystemExit included
        kind = "timeout" if isinstance(error, RunTimeout) else "exception"
        message = " ".join(str(error).split()) or type(error).__name__
        if kind == "exception":
            message = f"{type(error).__name__}: {message}"
        else:
            message = f"still running after {spec.timeout_s:g} s of wall time"
        return Outcome(
            spec,
            time.perf_counter() - started,
            code_with(spec.own_code),
            failure=kind,
            message=message,
            traceback=traceback.format_exc(),
        )
    wall_s = time.perf_counter() - started
    return Outcome(spec, wall_s, code_with(spec.own_code), values, event_hash, outages)


def _measure(spec: RunSpec) -> tuple[dict[str, float], str, Sequence[ServiceGap]]:
    modules = tuple(word.partition(":")[0] for word in spec.own_code.split())
    if imported_code(modules, spec.search_path) != spec.own_code:
        raise ConfigurationError(
            f"this worker imported an older {spec.own_code}: start the workers again"
        )
    if scenario_of(spec.scenario).model == "ideal":
        from drone_mesh.lab.ideal import run_ideal  # needs scipy, which a mesh does not

        return (*run_ideal(scenario_of(spec.scenario), Streams(spec.seed, spec.repetition)), ())
    simulation = simulation_of(spec)
    record = simulation.run()
    return measured(record, spec.own_metrics), simulation.event_hash(), record.gaps()


def simulation_of(spec: RunSpec) -> Simulation:
    """The run, before its start. Raises ConfigurationError for a layout that cannot be drawn."""
    if spec.search_path:
        extensions.add_search_path(spec.search_path)
    scenario = scenario_of(spec.scenario)
    kind = Simulation if scenario.sequence is None else SequenceRun
    return kind(scenario, Streams(spec.seed, spec.repetition))


def measured(record: RunRecord, own_metrics: tuple[str, ...]) -> dict[str, float]:
    """All metrics of a run, with the user's own ones last."""
    values = measure_all(record)
    for name in own_metrics:
        value = extensions.own_metric(name)(record)
        try:
            values[extensions.column_of(name)] = float(value)
        except (TypeError, ValueError):
            raise ConfigurationError(f"metric {name} returned {value!r}, not a number") from None
    return values


@functools.lru_cache(maxsize=1024)
def scenario_of(text: str) -> Scenario:
    return Scenario.model_validate(json.loads(text))


def metric_columns(own_metrics: tuple[str, ...]) -> list[str]:
    return [*METRICS, *map(extensions.column_of, own_metrics)]


def as_cell(value: float) -> str:
    """A metric as text: the same in each Python, empty if undefined."""
    return "" if math.isnan(value) else f"{round(value, 6):.10g}"


@contextlib.contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    """Raises RunTimeout in the thread that entered it when the time is over.

    A signal would reach only the main thread, but a worker runs its tasks in another one. It stops
    Python code, even an endless loop, but not a library call that never returns.
    """
    thread, lock, over = threading.get_ident(), threading.Lock(), threading.Event()

    def ring() -> None:
        with lock:
            if not over.is_set():
                raised = ctypes.py_object(RunTimeout)
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), raised)

    timer = threading.Timer(seconds, ring)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            over.set()
        timer.cancel()


@contextlib.contextmanager
def quiet_nodes() -> Iterator[None]:
    """Log only critical messages of the package; restore the level at the end."""
    logger = logging.getLogger("drone_mesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
