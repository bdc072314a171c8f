"""Long runs in simulated time: do memory, threads or connections grow?"""

from __future__ import annotations

import statistics
from dataclasses import asdict, dataclass
from typing import Iterator, Sequence

from drone_mesh.bench.measurement import MEGABYTE
from drone_mesh.bench.observation import StateSample
from drone_mesh.bench.system import System

SAMPLE_PERIOD_S = 60.0  # simulated
WARM_UP_S = 600.0  # simulated; growth before this is ignored
# Wall, after all are on. rospy closes a connection that was idle for 60 s; the master opens such
# connections when nodes register.
IDLE_CONNECTIONS_CLOSED_S = 90.0
MEMORY_TOLERANCE = 0.02  # our choice: normal variation of a Python program
SAMPLE_WITHIN_S = 600.0  # wall
FEWEST_SAMPLES = 3  # our choice; a single sample is always constant


@dataclass(frozen=True)
class Sample:
    """All processes at one moment."""

    sim_s: float
    wall_s: float  # since the launch
    pss_mb: float
    rss_mb: float
    threads: int
    open_files: int  # including connections
    routers_connected: int
    threads_of: dict[str, int]  # by process
    open_files_of: dict[str, int]


@dataclass(frozen=True)
class Verdict:
    """Growth after the first ten minutes.

    Memory is RSS: PSS also changes with other programs that share the same libraries.
    """

    memory_before_mb: float  # median of the first third of the samples after the warm-up
    memory_after_mb: float  # median of the last third
    threads: tuple[int, int]  # least and most
    open_files: tuple[int, int]
    changed: tuple[str, ...]  # the processes whose number of threads or files changed

    @property
    def memory_grew(self) -> bool:
        """Whether memory grew by more than the tolerance."""
        return self.memory_after_mb > self.memory_before_mb * (1 + MEMORY_TOLERANCE)

    @property
    def steady(self) -> bool:
        """Whether nothing grew."""
        return not self.memory_grew and all(
            least == most for least, most in (self.threads, self.open_files)
        )


@dataclass(frozen=True)
class SoakResult:
    """The samples of one fleet."""

    drones: int
    spacing_m: float
    samples: list[Sample]


def judge(samples: Sequence[Sample]) -> Verdict | None:
    """The verdict on these samples; None if the run was too short.

    Three samples after the warm-up, and three after idle connections were closed, are enough.
    """
    late = [sample for sample in samples if sample.sim_s >= WARM_UP_S]
    third = len(late) // FEWEST_SAMPLES
    settled = [s for s in late if s.wall_s - samples[0].wall_s >= IDLE_CONNECTIONS_CLOSED_S]
    if third == 0 or len(settled) < FEWEST_SAMPLES:
        return None
    threads = [sample.threads for sample in settled]
    files = [sample.open_files for sample in settled]
    return Verdict(
        changed=tuple(
            name
            for name in sorted({name for sample in settled for name in sample.threads_of})
            if len({sample.threads_of.get(name) for sample in settled}) > 1
            or len({sample.open_files_of.get(name) for sample in settled}) > 1
        ),
        memory_before_mb=statistics.median(sample.rss_mb for sample in late[:third]),
        memory_after_mb=statistics.median(sample.rss_mb for sample in late[-third:]),
        threads=(min(threads), max(threads)),
        open_files=(min(files), max(files)),
    )


def soak(system: System, hours: float) -> Iterator[Sample]:
    """Sample a fleet for `hours` of simulated time.

    Raises BenchmarkError if the fleet ends by itself or stops.
    """
    watch = system.watch
    assert watch.all_on is not None
    next_s = watch.all_on.sim_s
    end_s = next_s + hours * 3600.0

    def words() -> str:
        return f"simulated {watch.last.sim_s if watch.last else 0.0:.0f} s of {end_s:.0f} s"

    while next_s <= end_s:
        state = system.wait_until_s(next_s, SAMPLE_WITHIN_S, words, "a minute of simulated time")
        sample = _take_sample(system, state)
        system.progress.clear()
        yield sample
        next_s += SAMPLE_PERIOD_S


def _take_sample(system: System, sample: StateSample) -> Sample:
    processes = system.use().processes.values()
    return Sample(
        sim_s=sample.sim_s,
        wall_s=sample.wall_s - system.launched_s,
        pss_mb=sum(process.pss_bytes for process in processes) / MEGABYTE,
        rss_mb=sum(process.rss_bytes for process in processes) / MEGABYTE,
        threads=sum(process.threads for process in processes),
        open_files=sum(process.open_files for process in processes),
        routers_connected=sample.connected,
        threads_of={process.name: process.threads for process in processes},
        open_files_of={process.name: process.open_files for process in processes},
    )


def as_json(result: SoakResult) -> dict[str, object]:
    """The samples and their verdict."""
    verdict = judge(result.samples)
    return {
        **asdict(result),
        "verdict": None if verdict is None else {**asdict(verdict), "steady": verdict.steady},
    }
