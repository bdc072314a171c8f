"""The command line of the lab."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import Callable, Sequence

from drone_mesh.arguments import MOST, is_up_to, whole
from drone_mesh.compiled import core
from drone_mesh.errors import MeshError
from drone_mesh.lab.campaign import Campaign, OlderCodeError, merge
from drone_mesh.lab.estimate import estimate
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.experiment_keys import write_template
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.store import describe_folder
from drone_mesh.lab.terminal import PROGRAM, as_duration
from drone_mesh.stopping import ends_as
from drone_mesh.web.listening import MAX_PORT

CELLS_SHOWN = 30  # by `lab plan`
_RESULTS = "results folder of the experiment"

_Run = Callable[[argparse.Namespace], int]


@ends_as("lab")
def main(argv: Sequence[str] | None = None) -> int:
    """Returns the exit status: 0 done, 1 failed (runs, a check, an error), 2 usage, 130 Ctrl-C."""
    given = list(sys.argv[1:] if argv is None else argv)
    parser = _parser()
    options, after_options = parser.parse_known_args(given)
    if after_options:  # argparse accepts overrides only before an option
        if not hasattr(options, "overrides") or any(w.startswith("-") for w in after_options):
            parser.error(f"unrecognized arguments: {' '.join(after_options)}")
        options.overrides += after_options
    options.command_line = given
    run: _Run = options.run
    try:
        return run(options)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description="Experiments with the mesh: one file describes thousands of seeded runs, one "
        "command runs them on all cores or a cluster, one report shows the results.",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(run: _Run, words: str, **paths: str) -> argparse.ArgumentParser:
        """A command named like its function, with these paths."""
        added = commands.add_parser(run.__name__[1:], help=words, description=words)
        added.set_defaults(run=run)
        for name, about in paths.items():
            added.add_argument(name, type=Path, help=about)
        return added

    new = command(_new, "write a commented experiment to start from")
    new.add_argument("name", help="name of the experiment and of its file")

    plan = command(_plan, "show cells, runs and estimated time; writes nothing")
    _add_experiment(plan)
    trials = plan.add_mutually_exclusive_group()
    trials.add_argument("--no-estimate", action="store_true", help="skip the trial runs")
    trials.add_argument(
        "--estimate",
        action="store_true",
        help="make them also if the file names modules of its own, whose code they run",
    )

    run = command(_run, "execute the runs missing from the results folder")
    _add_experiment(run)
    run.add_argument(
        "--cluster", metavar="ADDRESS", help="a dask scheduler (tcp://host:8786), or slurm"
    )
    run.add_argument(
        "--shard", type=_shard, metavar="I/N", help="execute every N-th run, starting with the I-th"
    )
    run.add_argument("--out", type=Path, help="results folder (default: results/NAME)")
    run.add_argument("--retry-failed", action="store_true", help="repeat failed runs")
    run.add_argument(
        "--again", action="store_true", help="discard and repeat the runs of older code"
    )

    command(_status, "show the progress of a results folder", results=_RESULTS)
    merging = command(
        _merge, "merge shards into one results folder", into="results folder to create or extend"
    )
    merging.add_argument("shards", type=Path, nargs="+", help="results folders of the shards")

    report = command(_report, "write tables and figures as one HTML file", results=_RESULTS)
    report.add_argument("--out", type=Path, help="the page (default: RESULTS/report.html)")
    report.add_argument(
        "--export", metavar="FORMAT", action="append", default=[],
        choices=("png", "pdf", "svg", "csv", "latex", "parquet"),
        help="also write each figure (png, pdf, svg) or table (csv, latex) as a file, or all runs "
        "and outages (parquet); repeatable",
    )  # fmt: skip

    tables = command(_tables, "print the tables of the report as Markdown", results=_RESULTS)
    tables.add_argument(
        "--only", nargs="+", choices=("cells", "healing", "paired", "worst"), help="these alone"
    )

    check = command(
        _check,
        "judge what the experiment expects (`expect:`) on the intervals; exit status: 0 if all is "
        "met, 1 if anything is not met or not decided",
        results=_RESULTS,
    )
    check.add_argument("--junit", type=Path, metavar="FILE", help="also write it as JUnit XML")

    plot = command(_plot, "write one figure as SVG, light and dark", results=_RESULTS)
    plot.add_argument("figure", help="an axis of the sweep, healed_over_time or phases")
    plot.add_argument("out", type=Path, help="the file")
    plot.add_argument("--cells", default="", help="only these: axis=value[,axis=value...]")
    plot.add_argument("--metric", action="append", default=[], help="of the axis; repeatable")

    show = command(_show, "repeat one run, with all its events", results=_RESULTS)
    show.add_argument("run_id", metavar="RUN", help="id of the run, or the beginning of it")
    how = show.add_mutually_exclusive_group()
    how.add_argument("--page", type=Path, metavar="FILE", help="write a report page about the run")
    how.add_argument("--console", action="store_true", help="show it in the web console")
    show.add_argument(
        "--port",
        type=whole(0, MAX_PORT),
        default=9081,
        help="port for --console (default %(default)s)",
    )

    compare = command(
        _compare,
        "compare two cells, or two folders: differences paired by seed",
        results=_RESULTS,
    )
    compare.add_argument(
        "a", metavar="A", help="a cell: axis=value[,axis=value...]; or another results folder"
    )
    compare.add_argument("b", metavar="B", nargs="?", help="the other cell; not with a folder")
    compare.add_argument(
        "--metric",
        action="append",
        default=[],
        help="metric to compare; repeatable (default: those of the experiment)",
    )

    command(_metrics, "list all metrics with unit and definition")
    return parser


def _add_experiment(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, help="experiment file")
    parser.add_argument(
        "overrides", nargs="*", metavar="a.b=c", help="override a value of the file, as in seeds=50"
    )
    parser.add_argument(
        "--workers", type=whole(0, MOST), default=len(os.sched_getaffinity(0)), metavar="N",
        help="number of processes; 0: run in this process, for a debugger (default: one per core, "
        "%(default)s)",
    )  # fmt: skip


def _shard(text: str) -> tuple[int, int]:
    part, slash, parts = text.partition("/")
    if not (slash and is_up_to(parts, MOST) and is_up_to(part, int(parts) - 1)):
        raise argparse.ArgumentTypeError(f"expected I/N with 0 <= I < N, not {text}")
    return int(part), int(parts)


def _new(options: argparse.Namespace) -> int:
    path = write_template(options.name)
    print(f"wrote {path}; next: {PROGRAM} plan {path}")
    return 0


def _plan(options: argparse.Namespace) -> int:
    loaded = load_experiment(options.file, options.overrides)
    plan = Plan(loaded)
    for cell in plan.cells[:CELLS_SHOWN]:
        print(cell.label or "(one cell)")
    if len(plan.cells) > CELLS_SHOWN:
        print(f"... and {len(plan.cells) - CELLS_SHOWN} more")
    cells = len(plan.cells)
    control = f" + {plan.seeds} others for each baseline" if plan.controls else ""
    print(f"{cells} cell{'s' * (cells != 1)} x {plan.seeds} seeds{control} = {len(plan)} runs")
    print(f"core: {core()}")
    stop = loaded.experiment.stop
    if stop is not None:
        print(f"more seeds, up to {stop.max_seeds}, until {stop.metric} is precise enough")
    if loaded.own_modules and not options.estimate:
        print(f"no trial runs: they would import {', '.join(loaded.own_modules)}; see --estimate")
    elif not options.no_estimate:
        loaded.check_own_code()
        guess = estimate(plan, options.workers)
        workers = max(1, options.workers)
        print(
            f"about {as_duration(guess.wall_s)} on {workers} free core{'s' * (workers != 1)} "
            f"(from {guess.trials} trial runs; nothing was written)"
        )
        print(f"processor time per run: {guess.run_s * 1000:.0f} ms")
    return 0


def _run(options: argparse.Namespace) -> int:
    loaded = load_experiment(options.file, options.overrides)
    loaded.announce_own_code()
    folder = options.out or Path("results") / loaded.experiment.name
    if options.out is None and options.shard is not None:
        folder = folder.with_name(f"{folder.name}-shard-{options.shard[0]}-of-{options.shard[1]}")
    again = f"{PROGRAM} {shlex.join(options.command_line)}"
    campaign = Campaign(loaded, folder, [PROGRAM, *options.command_line])
    try:
        campaign.run(
            options.workers, options.cluster, options.shard, options.retry_failed, options.again
        )
    except KeyboardInterrupt:
        print(f"interrupted; {campaign.completed} runs were added to {folder}", file=sys.stderr)
        print(f"continue with: {again}", file=sys.stderr)
        return 130
    except OlderCodeError as error:
        raise MeshError(f"{error}\ncontinue with: {again} --again") from error
    except MeshError as error:
        raise MeshError(f"{error}\ncontinue with: {again}") from error
    print(describe_folder(folder))
    if loaded.experiment.expect:
        print(f"`{PROGRAM} check {folder}` judges what it expects")
    if campaign.failures:
        print(f"failed: {campaign.first_failure}")
        print(f"failed runs: {folder / 'failures.csv'} has the command that repeats each of them")
        return 1
    return 0


def _status(options: argparse.Namespace) -> int:
    print(describe_folder(options.results))
    return 0


def _merge(options: argparse.Namespace) -> int:
    count = merge(options.into, options.shards)
    print(f"{count} runs from {len(options.shards)} shards added")
    print(describe_folder(options.into))
    return 0


def _report(options: argparse.Namespace) -> int:
    # Here and below: only the analysis needs scipy, matplotlib and jinja2.
    from drone_mesh.lab.report import write_report

    for path in write_report(options.results, options.out, options.export):
        print(f"wrote {path}")
    return 0


def _tables(options: argparse.Namespace) -> int:
    from drone_mesh.lab.results import load_results
    from drone_mesh.lab.tables import all_tables, warning_of

    results = load_results(options.results)
    if warning_of(results):
        print(f"warning: {warning_of(results)}", file=sys.stderr)
    for table in all_tables(results):
        if options.only is None or table.name in options.only:
            print(f"{table.title}. {table.caption}\n\n{table.to_markdown()}")
    return 0


def _check(options: argparse.Namespace) -> int:
    from drone_mesh.lab.gate import MET, NOT_MET, UNDECIDED, judge, write_junit
    from drone_mesh.lab.results import load_results

    results = load_results(options.results)
    verdicts = judge(results)
    for verdict in verdicts:
        print(f"{verdict.outcome:11}  {verdict.name}: {verdict.reason}")
    found = [verdict.outcome for verdict in verdicts]
    print(", ".join(f"{found.count(kind)} {kind}" for kind in (MET, NOT_MET, UNDECIDED)))
    if options.junit is not None:
        write_junit(results, verdicts, options.junit)
        print(f"wrote {options.junit}")
    return 0 if found.count(MET) == len(found) else 1


def _plot(options: argparse.Namespace) -> int:
    from drone_mesh.lab.report import draw_alone
    from drone_mesh.lab.results import load_results

    results = load_results(options.results).only(options.cells, options.metric)
    draw_alone(results, options.figure, options.out)
    print(f"wrote {options.out}")
    return 0


def _show(options: argparse.Namespace) -> int:
    from drone_mesh.lab.show import show_run

    return show_run(options)


def _compare(options: argparse.Namespace) -> int:
    from drone_mesh.lab.comparison import print_cells, print_folders

    if options.b is None:
        print_folders(options.results, Path(options.a), options.metric)
    else:
        print_cells(options.results, options.a, options.b, options.metric)
    return 0


def _metrics(_options: argparse.Namespace) -> int:
    from drone_mesh.communication.wire.packet_types import MessageType
    from drone_mesh.lab.metrics import listed

    width = max(map(len, listed()))
    for name, metric in listed().items():
        print(f"{name:{width}}  {metric.unit:10}  {metric.definition}")
    print(f"TYPE: {', '.join(kind.name.lower() for kind in MessageType)}")
    return 0
