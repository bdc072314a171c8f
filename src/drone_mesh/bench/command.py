"""The command `rosrun drone_mesh bench`; without ROS: `python3 -m drone_mesh.bench`."""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, Callable, Sequence

from drone_mesh.arguments import MOST, whole
from drone_mesh.bench import cases, inprocess, overload, report, soak
from drone_mesh.bench.cases import Case
from drone_mesh.bench.measurement import RosResult, measure
from drone_mesh.bench.progress import ProgressLine
from drone_mesh.bench.system import BenchmarkError, System, check_environment, free_port
from drone_mesh.communication.seals.key_file import read_key_file
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.web.listening import MAX_PORT

WINDOW_S = 20.0  # two rounds of the default timing
QUICK_WINDOW_S = 10.0
RUNS = 5
QUICK_RUNS = 1
ROS, INPROCESS = "ros", "inprocess"
EXIT_FAILED, EXIT_INTERRUPTED = 1, 130

DESCRIPTION = """\
Starts the simulation once per size, measures it and prints tables. Uses its own ROS master
on a free port and stops everything that it started, also on Ctrl-C.
"""
EPILOG = """\
examples:
  rosrun drone_mesh bench --quick
  rosrun drone_mesh bench --sizes 100/6 100/1 --launch hosts:=2 --json result.json
  rosrun drone_mesh bench --hours 1                    an hour: memory, threads, connections
  rosrun drone_mesh bench --busy 2 4 8                 does a busy machine lose connections?
  python3 -m drone_mesh.bench --only inprocess         needs no ROS
"""


def _positive(text: str) -> float:
    with contextlib.suppress(ValueError):
        value = float(text)
        if 0 < value < float("inf"):
            return value
    raise argparse.ArgumentTypeError(f"invalid value {text!r}: must be a number above 0")


def _size(text: str) -> Case:
    try:
        return Case.parse(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _launch_arg(text: str) -> str:
    if ":=" not in text:
        raise argparse.ArgumentTypeError(f"invalid launch argument {text!r}: write name:=value")
    return text


def make_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        prog="bench",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer sizes and runs, under 2 minutes"
    )
    parser.add_argument(
        "--sizes",
        nargs="+",
        type=_size,
        metavar="DRONES/SPACING[@FACTOR][+fly]",
        help="fleets to measure; +fly: physics moves the drones, and all of them fly; default: "
        + " ".join(map(_in_short, cases.FULL)),
    )
    parser.add_argument("--only", choices=(ROS, INPROCESS), help="measure only this part")
    parser.add_argument(
        "--seconds",
        type=_positive,
        help=f"seconds to measure each size, of wall time (default: {WINDOW_S:g}); with --busy of "
        "simulated time",
    )
    parser.add_argument(
        "--hours",
        type=_positive,
        help="instead of the tables: run one size (default: "
        f"{_in_short(cases.SOAK)}) for this many hours of simulated time and report whether "
        "memory, threads or connections grow",
    )
    parser.add_argument(
        "--busy",
        nargs="+",
        type=whole(0, MOST),
        metavar="LOOPS",
        help="instead of the tables: run one size (default: "
        f"{_in_short(cases.OVERLOAD)}) for {overload.SIMULATED_S:g} simulated seconds beside each "
        "of these numbers of busy loops, and report how many connections are lost",
    )
    parser.add_argument(
        "--launch",
        nargs="+",
        type=_launch_arg,
        default=[],
        metavar="NAME:=VALUE",
        help="further arguments for factory.launch",
    )
    parser.add_argument(
        "--key-file",
        type=Path,
        metavar="FILE",
        help="seal all packets of the runs in process with this mesh key, and compare with and "
        "without it (over ROS: --launch key:=FILE)",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="also write all figures to this file"
    )
    parser.add_argument(
        "--port", type=whole(1, MAX_PORT), help="port of the ROS master; default: a free port"
    )
    return parser


def _in_short(case: Case) -> str:
    factor = "" if case.real_time_factor == 1 else f"@{case.real_time_factor:g}"
    return f"{case.drones}/{case.spacing_m:g}{factor}{f'+{cases.FLY}' if case.flying else ''}"


class Benchmark:
    """The options of one run, and the results so far."""

    def __init__(self, options: argparse.Namespace, progress: ProgressLine) -> None:
        self._options = options
        self._progress = progress
        self._machine = report.Machine.here()
        self._ros: list[RosResult] = []
        self._failed: list[dict[str, str]] = []
        self._inprocess: list[inprocess.InProcessResult] = []
        self._soak: soak.SoakResult | None = None
        self._overload: list[overload.OverloadResult] = []
        self._seal_cost: inprocess.SealCost | None = None
        self._key = None
        if options.key_file is not None:
            with naming_argument("--key-file ", options.key_file):
                self._key = read_key_file(options.key_file)

    def run(self) -> int:
        """Measure and return the exit code. An interrupted run prints its results so far."""
        options = self._options
        try:
            if options.hours is not None:
                self._run_one_fleet(
                    cases.SOAK, f"{options.hours:g} h of simulated time", self._run_soak
                )
            elif options.busy is not None:
                self._run_one_fleet(cases.OVERLOAD, "busy loops", self._run_overload)
            else:
                if options.only != INPROCESS:
                    self._run_ros()
                if options.only != ROS:
                    self._run_inprocess()
        except KeyboardInterrupt:
            self._progress.clear()
            print("interrupted", file=sys.stderr)
            self._print_results()
            return EXIT_INTERRUPTED
        self._print_results()
        verdict = soak.judge(self._soak.samples) if self._soak else None
        grew = verdict is not None and not verdict.steady
        lost = any(result.disconnected for result in self._overload)
        return EXIT_FAILED if self._failed or grew or lost else 0

    def _run_ros(self) -> None:
        options = self._options
        check_environment()
        sizes = options.sizes or (cases.QUICK if options.quick else cases.FULL)
        window_s = options.seconds or (QUICK_WINDOW_S if options.quick else WINDOW_S)
        for number, case in enumerate(sizes, start=1):
            self._progress.begin(f"[{number}/{len(sizes)}] {case}")
            self._run_fleet(case, lambda system: self._ros.append(measure(system, window_s)))

    def _run_one_fleet(self, usual: Case, what: str, use: Callable[[System], None]) -> None:
        check_environment()
        case = self._options.sizes[0] if self._options.sizes else usual
        self._progress.begin(f"{case}: {what}")
        self._run_fleet(case, use)

    def _run_fleet(self, case: Case, use: Callable[[System], None]) -> None:
        """Start a fleet, use and stop it; if it fails, note that."""
        options = self._options
        port = options.port or free_port()
        try:
            with System(case, options.launch, port, self._progress) as system:
                use(system)
        except BenchmarkError as error:
            self._progress.clear()
            self._failed.append({"case": str(case), "reason": str(error)})
            print(f"bench: {case}: {error}", file=sys.stderr)

    def _run_inprocess(self) -> None:
        runs = QUICK_RUNS if self._options.quick else RUNS
        self._progress.begin("in process")
        for drones in inprocess.SIZES:
            result = inprocess.measure(drones, runs, self._progress.say, key=self._key)
            self._inprocess.append(result)
        if self._key is not None:
            drones = inprocess.SIZES[len(inprocess.SIZES) // 2]
            self._seal_cost = inprocess.seal_cost(drones, runs, self._progress.say, self._key)
        self._progress.clear()

    def _run_soak(self, system: System) -> None:
        result = soak.SoakResult(system.case.drones, system.case.spacing_m, [])
        for sample in soak.soak(system, self._options.hours):
            result.samples.append(sample)
            print(report.sample_line(sample), flush=True)
        self._soak = result

    def _run_overload(self, system: System) -> None:
        seconds = self._options.seconds or overload.SIMULATED_S
        for result in overload.overload(system, self._options.busy, seconds):
            self._overload.append(result)
            print(report.overload_line(result), flush=True)

    def _print_results(self) -> None:
        sections = [f"Measured on {self._machine}."]
        if self._ros:
            sections.append(report.ros_tables(self._ros))
        if self._inprocess:
            sections.append(report.inprocess_table(self._inprocess))
        if self._seal_cost is not None:
            sections.append(report.seal_line(self._seal_cost))
        if self._soak is not None:
            sections.append(report.verdict_lines(self._soak))
        sections += [
            f"Failed: {failed['case']}: {failed['reason'].splitlines()[0]}"
            for failed in self._failed
        ]
        if len(sections) > 1:
            print("\n" + "\n\n".join(sections), flush=True)
        if self._options.json is not None:
            text = json.dumps(self._as_json(), indent=2) + "\n"
            self._options.json.write_text(text, encoding="utf-8")

    def _as_json(self) -> dict[str, Any]:
        return {
            "machine": asdict(self._machine),
            "ros": [asdict(result) for result in self._ros],
            "inprocess": [asdict(result) for result in self._inprocess],
            "seal": None if self._seal_cost is None else asdict(self._seal_cost),
            "overload": [asdict(result) for result in self._overload],
            "soak": None if self._soak is None else soak.as_json(self._soak),
            "failed": self._failed,
        }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command; exits with 0, with 1 after a failure, with 130 when interrupted."""
    options = make_parser().parse_args(arguments)
    if options.json is not None and not options.json.absolute().parent.is_dir():
        sys.exit(f"bench: --json {options.json}: no such directory")
    # TERM and Ctrl-C both stop the processes started here. A background job of a shell starts
    # with SIGINT ignored.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        sys.exit(Benchmark(options, ProgressLine(sys.stderr)).run())
    except (BenchmarkError, ConfigurationError) as error:
        sys.exit(f"bench: {error}")
