"""Lines for the log: which of them are due."""

from __future__ import annotations

from drone_mesh.communication.timing.throttle import Throttle


def test_each_reason_is_due_once_a_period_and_always_counted():
    throttle = Throttle(period_s=10.0)
    assert [throttle.count("bad", now_s) for now_s in (0.0, 9.9, 10.0, 10.1)] == [
        True,
        False,
        True,
        False,
    ]
    assert throttle.count("worse", 10.1)
    assert throttle.counts == {"bad": 4, "worse": 1}


def test_a_clock_that_jumped_back_silences_nothing():
    throttle = Throttle(period_s=10.0)
    throttle.count("bad", 500.0)
    assert throttle.count("bad", 1.0)
