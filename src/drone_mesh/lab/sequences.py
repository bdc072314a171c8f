"""Thousands of seeded sequences of faults: `python3 -m drone_mesh.lab.sequences --help`."""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import sys
import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Iterable, Iterator

from drone_mesh.communication.repair.options import DEFAULT_REPAIR
from drone_mesh.lab.quiet import quiet_nodes
from drone_mesh.lab.sequence import FIELDS, SequenceOutcome, run_sequence

PROGRESS_S = 5.0  # wall


def main(argv: list[str] | None = None) -> int:
    """Run the seeds missing from the table, then summarise it. Returns 1 if a drone did harm."""
    arguments = _arguments(argv)
    seeds = range(arguments.first, arguments.first + arguments.runs)
    rows = []
    if arguments.csv is not None:
        try:
            rows = _read(arguments.csv, seeds)
            arguments.csv.open("a").close()  # now, not after the first sequence
        except OSError as error:
            print(f"--csv {arguments.csv}: {error.strerror}", file=sys.stderr)
            return 2
        except (TypeError, ValueError, KeyError):
            print(f"--csv {arguments.csv}: not a table of this program", file=sys.stderr)
            return 2
    done = {row.seed for row in rows}
    try:
        with quiet_nodes():
            for outcome in _run([seed for seed in seeds if seed not in done], arguments):
                rows.append(outcome)
                if arguments.csv is not None:
                    _append(arguments.csv, outcome)
    except KeyboardInterrupt:
        print("stopped" + (": the same command continues" if arguments.csv is not None else ""))
    print(summary(rows, arguments.repair))
    return int(any(harm(row) for row in rows))


def harm(row: SequenceOutcome) -> bool:
    """Whether a sequence contains something that a repair must never do."""
    return bool(
        row.stacked or row.flew_connected or row.flew_grounded or row.unexplained or row.endless
    )


def summary(rows: list[SequenceOutcome], repair: str) -> str:
    """A summary of a table of outcomes, as lines of text."""
    if not rows:
        return "no sequence was run"
    runs = len(rows)
    cut_off, healed = sum(row.cut_off for row in rows), sum(row.healed for row in rows)
    flights, flown_m = sum(row.flights for row in rows), sum(row.flown_m for row in rows)

    def share(name: str) -> str:
        sequences = sum(getattr(row, name) > 0 for row in rows)
        return f"{sequences} of {runs} sequences ({100.0 * sequences / runs:.2f} %)"

    lines = [
        f"repair {repair}: {runs} sequences, seeds {min(r.seed for r in rows)}.."
        f"{max(r.seed for r in rows)}",
        f"  living drones at rest within 0.5 m of each other: {share('stacked')}",
        f"  a connected drone flew:                           {share('flew_connected')}",
        f"  a drone that cannot fly was sent:                 {share('flew_grounded')}",
        f"  cut off at the end, but able to fly to a gateway: {share('unexplained')}",
        f"  a heartbeat reached the limit of hops:            {share('endless')}",
        f"  nodes that were cut off:                          {cut_off}",
        f"  connected again within 120 s:                     {healed}"
        f" ({100.0 * healed / max(cut_off, 1):.1f} %)",
        f"  flights: {flights}, per healed node {flights / max(healed, 1):.2f}; "
        f"flown {flown_m:.0f} m, per healed node {flown_m / max(healed, 1):.2f} m",
    ]
    harmed = [row for row in rows if harm(row)]
    lines += [f"  seed {row.seed}: {row.incidents}: {row.why[:200]}" for row in harmed[:20]]
    return "\n".join(lines)


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="drone_mesh.lab.sequences",
        description="Runs random meshes of 8..60 nodes through random faults under a virtual "
        "clock: cut vertices and shares of nodes are killed, also in negotiations and in flight, "
        "and the gateway is switched off and moved. Prints how the repair handled them.",
    )
    parser.add_argument(
        "--runs", type=int, default=100, help="number of sequences (default: %(default)s)"
    )
    parser.add_argument("--first", type=int, default=0, help="first seed (default: %(default)s)")
    parser.add_argument(
        "--repair",
        default=DEFAULT_REPAIR,
        help="repair strategy: a name, or package.module:Class (default: %(default)s)",
    )
    parser.add_argument(
        "--workers", type=int, default=1, help="number of processes (default: %(default)s)"
    )
    parser.add_argument(
        "--csv",
        type=Path,
        help="table of outcomes, one row per seed; seeds that it already holds are not run again",
    )
    return parser.parse_args(argv)


def _run(seeds: list[int], arguments: argparse.Namespace) -> Iterator[SequenceOutcome]:
    jobs = [(seed, arguments.repair) for seed in seeds]
    if arguments.workers <= 1:
        yield from _with_progress((run_sequence(*job) for job in jobs), len(jobs))
        return
    with multiprocessing.Pool(arguments.workers) as pool:
        yield from _with_progress(pool.imap_unordered(_run_job, jobs), len(jobs))


def _run_job(job: tuple[int, str]) -> SequenceOutcome:
    return run_sequence(*job)


def _with_progress(outcomes: Iterable[SequenceOutcome], total: int) -> Iterator[SequenceOutcome]:
    begun_s = shown_s = time.monotonic()
    harmed = 0
    for number, outcome in enumerate(outcomes, start=1):
        harmed += harm(outcome)
        now_s = time.monotonic()
        if now_s - shown_s >= PROGRESS_S:
            shown_s = now_s
            left_s = (now_s - begun_s) / number * (total - number)
            print(
                f"{number} of {total} sequences, {harmed} with harm, {left_s:.0f} s left",
                file=sys.stderr,
            )
        yield outcome


def _read(path: Path, seeds: range) -> list[SequenceOutcome]:
    if not path.exists():
        return []
    kinds: dict[str, Any] = {field.name: type(field.default) for field in fields(SequenceOutcome)}
    kinds.update(seed=int, nodes=int, incidents=str)
    with path.open(newline="", encoding="utf-8") as table:
        rows = [
            SequenceOutcome(**{name: kinds[name](text) for name, text in row.items()})
            for row in csv.DictReader(table)
        ]
    return [row for row in rows if row.seed in seeds]


def _append(path: Path, outcome: SequenceOutcome) -> None:
    with path.open("a", newline="", encoding="utf-8") as table:
        writer = csv.DictWriter(table, FIELDS)
        if table.tell() == 0:
            writer.writeheader()
        writer.writerow(asdict(outcome))


if __name__ == "__main__":
    sys.exit(main())
