"""MeshExecutor, with a clock that the test moves."""

from __future__ import annotations

import logging
import math
import threading
import time

import pytest

from drone_mesh.execution import REQUESTS_PER_STEP, MeshExecutor, PacketInbox

PATIENCE_S = 5.0  # for threads; nothing here takes a hundredth of it


class HandClock:
    """Simulated time: stands still until the test moves it."""

    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


class Ticker:
    """A component that only notes when it was ticked, and then waits for the next round."""

    def __init__(self, first_s, period_s=math.inf):
        self.next_tick_s, self._period_s, self.ticks = first_s, period_s, []

    def tick(self, now_s):
        self.ticks.append((now_s, threading.get_ident()))
        self.next_tick_s += self._period_s


class Stubborn(Ticker):
    """Fails in each tick and stays due, as a component with a bug would."""

    def tick(self, now_s):
        self.ticks.append((now_s, threading.get_ident()))
        raise RuntimeError("a bug")


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def executor(clock):
    executor = MeshExecutor(clock, clock_notifies=True)
    executor.start()
    yield executor
    executor.stop()


def settle(executor):
    """Returns when the worker has done what was submitted so far and what is due now."""
    for done in (threading.Event(), threading.Event()):
        executor.submit(lambda _now_s, done=done: done.set())
        assert done.wait(PATIENCE_S), "the worker did not come to the submitted function"


def advance(executor, clock, now_s):
    clock.now_s = now_s
    executor.time_advanced()
    settle(executor)


def slot_with(executor, driven):
    slot = executor.slot()
    slot.submit(lambda _now_s: slot.drive(driven))
    settle(executor)
    return slot


def test_functions_run_in_the_order_of_submission_with_the_time(executor, clock):
    seen = []
    clock.now_s = 3.5
    for number in range(100):
        executor.submit(lambda now_s, number=number: seen.append((number, now_s)))
    settle(executor)
    assert seen == [(number, 3.5) for number in range(100)]


def test_a_component_is_ticked_when_it_is_due_and_not_before(executor, clock):
    ticker = Ticker(first_s=10.0, period_s=10.0)
    slot_with(executor, ticker)
    advance(executor, clock, 9.99)
    assert ticker.ticks == []
    advance(executor, clock, 10.0)
    advance(executor, clock, 19.0)
    advance(executor, clock, 20.5)
    assert [now_s for now_s, _ in ticker.ticks] == [10.0, 20.5]


def test_everything_runs_on_one_thread_that_is_not_the_callers(executor, clock):
    tickers = [Ticker(first_s=1.0), Ticker(first_s=1.0)]
    for ticker in tickers:
        slot_with(executor, ticker)
    threads = []
    executor.submit(lambda _now_s: threads.append(threading.get_ident()))
    advance(executor, clock, 1.0)
    threads += [ident for ticker in tickers for _, ident in ticker.ticks]
    assert len(threads) == 3
    assert len(set(threads)) == 1
    assert threads[0] != threading.get_ident()


def test_a_deadline_that_a_packet_moved_forward_is_kept(executor, clock):
    ticker = Ticker(first_s=100.0)
    slot = slot_with(executor, ticker)
    slot.submit(lambda _now_s: setattr(ticker, "next_tick_s", 2.0))
    settle(executor)
    advance(executor, clock, 2.0)
    assert [now_s for now_s, _ in ticker.ticks] == [2.0]


def test_a_deadline_that_was_put_off_does_not_fire_at_the_old_time(executor, clock):
    ticker = Ticker(first_s=1.0)
    slot = slot_with(executor, ticker)
    slot.submit(lambda _now_s: setattr(ticker, "next_tick_s", 5.0))
    settle(executor)
    advance(executor, clock, 1.0)
    assert ticker.ticks == []
    advance(executor, clock, 5.0)
    assert [now_s for now_s, _ in ticker.ticks] == [5.0]


def test_an_exception_in_one_component_is_logged_once_and_stops_no_other(executor, clock, caplog):
    stubborn, ticker = Stubborn(first_s=1.0), Ticker(first_s=1.0, period_s=1.0)
    slot_with(executor, stubborn)
    slot_with(executor, ticker)
    with caplog.at_level(logging.ERROR):
        for now_s in (1.0, 2.0, 3.0):
            advance(executor, clock, now_s)
    assert [now_s for now_s, _ in ticker.ticks] == [1.0, 2.0, 3.0]
    assert executor.failures == {"RuntimeError": 3}
    assert len(caplog.records) == 1
    assert "a bug" in str(caplog.records[0].exc_info[1])


def test_a_component_that_fails_and_stays_due_is_not_called_in_a_tight_loop(executor, clock):
    stubborn = Stubborn(first_s=1.0)
    slot_with(executor, stubborn)
    advance(executor, clock, 1.0)
    advance(executor, clock, 1.9)
    settle(executor)
    assert [now_s for now_s, _ in stubborn.ticks] == [1.0]


def test_call_every_skips_the_periods_it_slept_through_and_ends_when_cancelled(executor, clock):
    calls = []
    stop = executor.call_every(1.0, calls.append)
    settle(executor)
    for now_s in (0.5, 1.0, 4.5, 5.0):
        advance(executor, clock, now_s)
    assert calls == [1.0, 4.5, 5.0]
    stop()
    advance(executor, clock, 20.0)
    assert calls == [1.0, 4.5, 5.0]


def test_lateness_is_measured_in_seconds_of_the_clock(executor, clock):
    slot_with(executor, Ticker(first_s=1.0))
    started, go_on = threading.Event(), threading.Event()

    def block(_now_s):
        started.set()
        go_on.wait(PATIENCE_S)

    executor.submit(block)
    assert started.wait(PATIENCE_S), "the worker did not start"
    clock.now_s = 1.25
    assert executor.lag_s(1.25) == pytest.approx(1.25)  # what blocks was submitted at 0
    go_on.set()
    executor.time_advanced()
    settle(executor)
    assert executor.take_worst_lag_s() == pytest.approx(0.25)
    assert executor.take_worst_lag_s() == 0.0
    assert executor.lag_s(1.25) == 0.0


def test_it_reports_when_no_work_is_left_and_not_before(clock):
    executor = MeshExecutor(clock, clock_notifies=True)
    seen = []
    idle = threading.Event()
    executor.when_idle(lambda: (seen.append("idle"), idle.set()))
    for number in range(3):
        executor.submit(lambda _now_s, number=number: seen.append(number))
    executor.start()
    assert idle.wait(PATIENCE_S), "it never said that it is idle"
    executor.stop()
    assert seen[:4] == [0, 1, 2, "idle"]


def test_a_burst_of_requests_lets_the_clock_go_on_between_a_few_of_them(clock):
    executor = MeshExecutor(clock, clock_notifies=True)
    slot, seen, done = executor.slot(), [], threading.Event()

    def on_idle():
        seen.append(f"{executor.lag_s(clock.now_s):g} s late")
        if len(seen) > 2 * REQUESTS_PER_STEP:
            done.set()
        clock.now_s += 0.01
        executor.time_advanced()

    executor.when_idle(on_idle)
    for _ in range(2 * REQUESTS_PER_STEP):
        slot.request(lambda now_s: seen.append(now_s))
    slot.submit(lambda now_s: seen.append("a packet"))
    executor.start()
    assert done.wait(PATIENCE_S), "requests are left"
    executor.stop()
    a_few = REQUESTS_PER_STEP
    first, second = [0.0] * a_few, [0.01] * a_few
    assert seen[: 2 * a_few + 3] == ["a packet", *first, "0 s late", *second, "0 s late"]


def test_requests_are_served_while_the_clock_stands_still(executor, clock):
    served = threading.Event()
    for _ in range(REQUESTS_PER_STEP):
        executor.request(lambda _now_s: None)
    executor.request(lambda _now_s: served.set())
    assert served.wait(PATIENCE_S), "the last request waits for the clock"


def test_stop_works_off_what_was_submitted_and_joins_the_thread(clock):
    executor = MeshExecutor(clock, clock_notifies=True, name="joined")
    executor.start()
    seen = []
    for number in range(50):
        executor.submit(lambda _now_s, number=number: seen.append(number))
    executor.stop()
    assert seen == list(range(50))
    assert "joined" not in [thread.name for thread in threading.enumerate()]


def test_a_clock_that_runs_by_itself_needs_no_poke():
    executor = MeshExecutor(time.monotonic, clock_notifies=False)
    executor.start()
    called = threading.Event()
    executor.call_every(0.01, lambda _now_s: called.set())
    assert called.wait(PATIENCE_S), "call_every was not called"
    executor.stop()


def test_an_inbox_holds_a_bounded_number_of_packets():
    waiting, handled = [], []
    inbox = PacketInbox(waiting.append, most=3)
    for packet in range(5):
        inbox.put(lambda now_s, packet=packet: handled.append((packet, now_s)))
    assert len(waiting) == 3
    assert inbox.dropped == 2
    waiting.pop(0)(1.0)
    inbox.put(lambda now_s: handled.append(("new", now_s)))
    for function in waiting:
        function(2.0)
    assert handled == [(0, 1.0), (1, 2.0), (2, 2.0), ("new", 2.0)]
