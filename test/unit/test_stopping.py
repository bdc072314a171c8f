"""How programs start; StopRequest, as signal handlers and threads use it."""

from __future__ import annotations

import gc
import os
import resource
import signal
import threading
import time
from pathlib import Path

import pytest

from drone_mesh.stopping import StopRequest, loading

LONG_S = 60.0
PROGRAMS = Path(__file__).resolve().parents[2] / "nodes"


def test_no_garbage_is_looked_for_in_what_a_program_imports():
    frozen = gc.get_freeze_count()
    with loading():
        during = gc.isenabled()
    try:
        assert not during
        assert gc.isenabled()
        assert gc.get_freeze_count() > frozen
    finally:
        gc.unfreeze()


def test_each_program_loads_so():
    for program in PROGRAMS.iterdir():
        assert "\nwith loading():\n    from drone_mesh." in program.read_text(), program.name


def test_a_request_that_was_not_made_is_waited_for_no_longer_than_asked():
    with StopRequest() as request:
        assert not request.wait(0.0)
        assert not request.wait(0.001)
        assert not request.is_made()


def test_each_thread_that_waits_sees_a_request_now_and_later():
    seen = []
    with StopRequest() as request:
        threads = [
            threading.Thread(target=lambda: seen.append(request.wait(LONG_S))) for _ in range(3)
        ]
        for thread in threads:
            thread.start()
        request.make()
        request.make()
        for thread in threads:
            thread.join(LONG_S)
        assert seen == [True, True, True]
        assert request.wait(LONG_S)


def test_a_signal_handler_makes_it_while_its_own_thread_waits():
    """At 300 different moments of the wait, which would catch a lock that the thread holds."""
    before = signal.getsignal(signal.SIGUSR1)
    try:
        for _round in range(300):
            with StopRequest() as request:
                signal.signal(signal.SIGUSR1, lambda *_: request.make())
                sender = threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGUSR1))
                sender.start()
                while not request.wait(0.00001):
                    pass
                sender.join()
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_a_signal_that_another_thread_takes_is_handled_while_the_main_thread_waits():
    """Python handles it in the main thread, whose system call it does not interrupt."""
    before = signal.getsignal(signal.SIGUSR1)
    waits, end = threading.Event(), threading.Event()
    with StopRequest() as request:

        def take() -> None:
            waits.wait(LONG_S)
            signal.pthread_kill(threading.get_ident(), signal.SIGUSR1)
            end.wait(LONG_S)

        taker = threading.Thread(target=take)
        taker.start()
        try:
            signal.signal(signal.SIGUSR1, lambda *_: request.make())
            threading.Timer(0.1, waits.set).start()  # the wait has begun by then
            begun_s = time.monotonic()
            assert request.wait(LONG_S)
            assert time.monotonic() - begun_s < LONG_S / 2, "only when the wait ended"
        finally:
            signal.signal(signal.SIGUSR1, before)
            end.set()
            taker.join(LONG_S)


def test_it_works_in_a_program_with_a_thousand_open_sockets():
    limit, _most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit < 1100:
        pytest.skip(f"this machine allows {limit} open files")
    opened = [os.open(os.devnull, os.O_RDONLY) for _ in range(1030)]
    try:
        with StopRequest() as request:
            assert not request.wait(0.0)
            request.make()
            assert request.wait(LONG_S)
    finally:
        for descriptor in opened:
            os.close(descriptor)


def test_closing_it_ends_waits_that_start_later():
    request = StopRequest()
    request.close()
    request.make()
    assert request.wait(LONG_S)
