"""Waiting for a condition, in wall time."""

from __future__ import annotations

import time
from typing import Callable

import rospy

_POLL_PERIOD_S = 0.05  # wall


def comes_true(
    condition: Callable[[], bool],
    within_s: float,
    give_up: Callable[[], bool] = rospy.is_shutdown,
) -> bool:
    """Whether the condition comes true within this wall time, and before `give_up` does."""
    deadline_s = time.monotonic() + within_s
    while not condition():
        if time.monotonic() >= deadline_s or give_up():
            return False
        time.sleep(_POLL_PERIOD_S)
    return True
