"""The measured cost of real processes."""

import subprocess
import sys
import time

import psutil
import pytest

from drone_mesh.bench.processes import ProcessUse, Use, cores_between, family, name_of, take_use

pytestmark = pytest.mark.slow

BUSY = "x = bytearray(40_000_000)\nprint('up', flush=True)\nwhile True: pass"
IDLE = "print('up', flush=True)\nimport sys; sys.stdin.read()"


@pytest.fixture
def start():
    started = []

    def start(code):
        process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        started.append(process)
        assert process.stdout.readline() == b"up\n"
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stdin.close()


def test_the_busy_process_uses_a_core_or_what_it_gets_of_one_and_the_idle_one_none(start):
    busy, idle = start(BUSY), start(IDLE)
    processes = [psutil.Process(busy.pid), psutil.Process(idle.pid)]
    before = take_use(processes, time.monotonic())
    deadline_s = time.monotonic() + 30
    while True:
        after = take_use(processes, time.monotonic())
        if after.processes[busy.pid].cpu_s - before.processes[busy.pid].cpu_s >= 0.1:
            break
        assert time.monotonic() < deadline_s, "a busy loop got no 0.1 s of processor time in 30 s"
    used = {
        pid: after.processes[pid].cpu_s - before.processes[pid].cpu_s
        for pid in (busy.pid, idle.pid)
    }
    assert used[idle.pid] < 0.05
    assert after.processes[busy.pid].rss_bytes > 40_000_000
    assert after.processes[busy.pid].rss_bytes >= after.processes[busy.pid].pss_bytes
    assert after.processes[idle.pid].open_files >= 3


def test_a_family_is_a_process_and_its_descendants(start):
    parent = start(
        "import subprocess, sys\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import sys; sys.stdin.read()'])\n"
        "print('up', flush=True)\nsys.stdin.read(); child.wait()"
    )
    assert len(family(parent.pid)) == 2
    parent.stdin.close()
    parent.wait()
    assert family(parent.pid) == []


def test_a_process_that_has_ended_is_left_out(start):
    gone, there = start(IDLE), start(IDLE)
    processes = [psutil.Process(gone.pid), psutil.Process(there.pid)]
    gone.kill()
    gone.wait()
    assert list(take_use(processes, 0.0).processes) == [there.pid]


def use(wall_s, **cpu_s_of):
    return Use(
        wall_s,
        {
            pid: ProcessUse(name.rstrip("_"), cpu_s, 0, 0, 1, 3)
            for pid, (name, cpu_s) in enumerate(cpu_s_of.items())
        },
    )


def test_cores_are_seconds_of_work_per_second_summed_over_processes_of_one_name():
    before = use(100.0, host=10.0, host_=5.0, world=1.0)
    after = use(110.0, host=14.0, host_=7.0, world=1.5, newcomer=9.0)
    assert cores_between(before, after) == pytest.approx({"host": 0.6, "world": 0.05})


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (
            ["python3", "/opt/nodes/drone_factory", "__name:=DroneFactory", "__log:=x"],
            "DroneFactory",
        ),
        (["/usr/bin/python3", "-u", "/usr/bin/rosmaster", "--core"], "rosmaster"),
        (["/usr/lib/rosout/rosout", "__name:=rosout-1"], "rosout-1"),
        (["python3"], "python3"),
        ([], "?"),
    ],
)
def test_a_process_is_named_after_its_node_or_else_its_program(arguments, name):
    assert name_of(arguments) == name
