"""OrderQueue: orders of ground stations for a drone manager, which may take its time."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Callable

from drone_mesh.drone.location import Location

LATE_S = 5.0  # wall: an older order is not carried out, as nobody expects that flight any more


class OrderQueue:
    """Carries out one order after the other, in a thread of its own."""

    def __init__(self, carry_out: Callable[[int, Location], str]) -> None:
        """`carry_out` may block; it returns why the mesh does not have the order, or nothing."""
        self._carry_out = carry_out
        self._ended = threading.Event()
        self._thread = ThreadPoolExecutor(1, "orders of ground stations")

    def give(self, node: int, goal: Location, answer: Callable[[str], None]) -> None:
        """Carry this out soon, and then call `answer`; as OrderDrone. Any thread."""
        given_s = time.monotonic()

        def order() -> None:
            if self._ended.is_set():
                return
            is_late = time.monotonic() - given_s > LATE_S
            answer("the drone manager is too busy" if is_late else self._carry_out(node, goal))

        self._thread.submit(order)

    def stop(self) -> None:
        """End the thread after the order that it carries out; those that wait are dropped."""
        self._ended.set()
        self._thread.shutdown()
