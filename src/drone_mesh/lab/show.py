"""Repeats one run of a results folder with all its events."""

from __future__ import annotations

import argparse
import json
import time
from typing import NamedTuple, Sequence

from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.lab.plan import PlannedRun
from drone_mesh.lab.provenance import code_with
from drone_mesh.lab.record import RunRecord
from drone_mesh.lab.results import Results, load_results
from drone_mesh.lab.worker import measured, scenario_of, simulation_of
from drone_mesh.state.model import MeshStatus

POLL_PERIOD_S = 0.5  # period of checks for Ctrl-C


class Replay(NamedTuple):
    """A repeated run."""

    planned: PlannedRun
    label: str
    states: Sequence[MeshStatus]  # one per sample
    record: RunRecord
    event_hash: str


def replay(results: Results, beginning: str) -> Replay:
    """Run it again. Raises MeshError like the run itself."""
    planned = results.find_run(beginning)
    spec = planned.spec
    if scenario_of(spec.scenario).model == "ideal":
        raise ConfigurationError(f"run {spec.run} uses model ideal, which has no events to show")
    simulation = simulation_of(spec)
    states: list[MeshStatus] = []
    record = simulation.run(states.append)
    label = results.loaded.cells[planned.cell].label
    return Replay(planned, label, states, record, simulation.event_hash())


def explain_hash(results: Results, shown: Replay) -> str:
    """Whether this run reproduced the stored one, and if not, why."""
    run = shown.planned.spec.run
    row = results.rows.get(run)
    if row is None:
        return f"event hash {shown.event_hash}; the folder has no row of this run to compare with"
    if row["event_hash"] == shown.event_hash:
        return f"event hash {shown.event_hash}: reproduces the run in {results.folder}"
    now = code_with(shown.planned.spec.own_code)
    why = (
        f"the row was computed by code {row['code']}, this is {now}"
        if row["code"] != now
        else "the code is the same: does a technique draw its own random numbers, or read a clock?"
    )
    return f"a different run: event hash {shown.event_hash}, the row has {row['event_hash']}; {why}"


def show_run(options: argparse.Namespace) -> int:
    """`lab show`: 0, or 1 if it was not the same run."""
    results = load_results(options.results)
    results.loaded.announce_own_code()
    shown = replay(results, options.run_id)
    title = f"{results.loaded.experiment.name} {shown.planned.spec.run}"
    verdict = explain_hash(results, shown)
    if options.page is not None:
        _write_page(options, shown, title)
    elif options.console:
        print(verdict)  # before it serves, which lasts until Ctrl-C
        _serve(shown, title, options.port)
    else:
        _print_story(shown)
    if not options.console:
        print(verdict)
        measured(shown.record, shown.planned.spec.own_metrics)  # raises as in the run
    row = results.rows.get(shown.planned.spec.run)
    return 0 if row is None or row["event_hash"] == shown.event_hash else 1


def _print_story(shown: Replay) -> None:
    spec = shown.planned.spec
    print(f"run {spec.run}, seed {spec.seed}, repetition {spec.repetition}: {shown.label}")
    print(json.dumps(json.loads(spec.scenario), indent=1))
    happened = [
        (item.at_s, f"fault: {item.action} {list(item.nodes)}") for item in shown.record.happened
    ]
    events = [
        (
            event.stamp_s,
            f"node {event.node}: {event.kind} {list(event.peers) or ''} {event.explanation()}",
        )
        for event in shown.record.events
    ]
    for at_s, text in sorted([*happened, *events], key=lambda line: line[0]):
        print(f"{at_s:10.3f} s  {text.rstrip()}")


def _write_page(options: argparse.Namespace, shown: Replay, title: str) -> None:
    # Only a page needs matplotlib and jinja2.
    from drone_mesh.lab.run_report.page import render_page
    from drone_mesh.lab.run_report.story import tell_story

    text = render_page(tell_story(shown.states, shown.record.events), title)
    try:
        with options.page.open("w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)  # with file names
    except OSError as error:
        raise MeshError(f"cannot write {options.page}: {error.strerror}") from error
    print(f"wrote {options.page}")


def _serve(shown: Replay, title: str, port: int) -> None:
    """The web console with a time line, until Ctrl-C.

    Raises ConfigurationError if the port is not available.
    """
    # Only this needs the console.
    from drone_mesh.console.controls import RecordingControls
    from drone_mesh.console.frame_store import FrameStore
    from drone_mesh.console.history import History
    from drone_mesh.console.runner import ConsoleRunner
    from drone_mesh.console.server import ConsoleServer
    from drone_mesh.web import LOOPBACK
    from drone_mesh.web.access import Access

    whole = History.of_run(shown.states, shown.record.events)
    server = ConsoleServer(
        FrameStore(), RecordingControls(), Access(), recording=title, whole=whole, is_played=False
    )
    runner = ConsoleRunner(server, LOOPBACK, port)
    runner.start()
    print(f"{title}: {runner.url}  (Ctrl-C ends it)", flush=True)
    try:
        while True:
            time.sleep(POLL_PERIOD_S)
    except KeyboardInterrupt:
        pass
    finally:
        runner.stop()
