"""The cost of processes: processor time, memory, threads, open files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Iterable, Mapping

import psutil

_NODE_NAME = "__name:="


@dataclass(frozen=True)
class ProcessUse:
    """One process at one moment."""

    name: str
    cpu_s: float  # since it started, user and system
    pss_bytes: int  # memory; shared pages are divided among the processes
    rss_bytes: int  # memory; shared pages count in each process
    threads: int
    open_files: int  # including sockets


@dataclass(frozen=True)
class Use:
    """A group of processes at one moment, by process id."""

    wall_s: float  # time.monotonic
    processes: Mapping[int, ProcessUse]


def family(pid: int) -> list[psutil.Process]:
    """A process and its descendants; empty if it has ended."""
    try:
        parent = psutil.Process(pid)
        return [parent, *parent.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def name_of(arguments: list[str]) -> str:
    """The name of a process: its ROS node, else its program, without the interpreter."""
    for argument in arguments:
        if argument.startswith(_NODE_NAME):
            return argument[len(_NODE_NAME) :]
    for argument in arguments:
        program = os.path.basename(argument)
        if argument and not argument.startswith("-") and not program.startswith("python"):
            return program
    return os.path.basename(arguments[0]) if arguments else "?"


def take_use(processes: Iterable[psutil.Process], wall_s: float) -> Use:
    """The current use of each process, except those that have ended."""
    found: dict[int, ProcessUse] = {}
    for process in processes:
        try:
            with process.oneshot():
                cpu = process.cpu_times()
                memory = process.memory_full_info()
                found[process.pid] = ProcessUse(
                    name=name_of(process.cmdline()),
                    cpu_s=cpu.user + cpu.system,
                    pss_bytes=memory.pss,
                    rss_bytes=memory.rss,
                    threads=process.num_threads(),
                    open_files=process.num_fds(),
                )
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue
    return Use(wall_s, found)


def cores_between(before: Use, after: Use) -> dict[str, float]:
    """Cores used by the processes that are in both, by name."""
    seconds = after.wall_s - before.wall_s
    cores: dict[str, float] = {}
    for pid, process in after.processes.items():
        if pid in before.processes:
            used_s = process.cpu_s - before.processes[pid].cpu_s
            cores[process.name] = cores.get(process.name, 0.0) + used_s / seconds
    return cores
