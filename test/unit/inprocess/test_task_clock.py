"""The clock of the network on emulated chips."""

from __future__ import annotations

from drone_mesh.inprocess.clock import TaskClock


def test_an_event_is_never_called_before_its_time_however_that_is_rounded():
    """Or else a component would find nothing due, and plan the same tick again for ever."""
    planned_s = 4.9162779610000005  # times 10**9 it is rounded to 4916277961.0
    clock = TaskClock()
    called: list[float] = []
    clock.call_at(planned_s, lambda _argument: called.append(clock.now_s), None)
    clock.run_until(5.0)
    assert len(called) == 1
    assert called[0] >= planned_s
