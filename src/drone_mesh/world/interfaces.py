"""World: what BulletWorld and StillWorld have in common, and what moves in them."""

from __future__ import annotations

import abc
from collections import deque
from typing import Protocol, TypeVar

from drone_mesh.air.box import Box
from drone_mesh.drone.flight_path import Vector

_AnyWorld = TypeVar("_AnyWorld", bound="World")

TICKS_PER_S = 100  # steps and /clock per second of simulated time


class Mover(Protocol):
    """Something that needs a turn in each step for as long as it moves."""

    def step(self, now_s: float) -> bool:
        """Move on to `now_s`, in the world's thread; True while it wants another turn."""


class World(abc.ABC):
    """Bodies and simulated time, which advances by one fixed tick per `step()`.

    Everything belongs to the thread that calls `step()`, except `wake()` and `now_s`, which any
    thread may use. Only movers that were woken cost time in a step. A world is a context manager
    that closes itself.
    """

    tick_s = 1.0 / TICKS_PER_S

    def __init__(self) -> None:
        self._ticks = 0
        self._woken: deque[Mover] = deque()  # filled by any thread, emptied by the world's
        self._moving: dict[Mover, None] = {}  # an ordered set: runs can be repeated

    @property
    def now_s(self) -> float:
        """Simulated seconds since the start: ticks counted and not summed, so there is no drift."""
        return self._ticks / TICKS_PER_S

    def step(self) -> float:
        """Advance one tick and whatever moves; return the simulated seconds since the start."""
        self._ticks += 1
        now_s = self.now_s
        while self._woken:
            self._moving[self._woken.popleft()] = None
        resting = [mover for mover in self._moving if not mover.step(now_s)]
        for mover in resting:
            del self._moving[mover]
        self._advance()
        return now_s

    def wake(self, mover: Mover) -> None:
        """Give `mover` a turn in each step from the next one on, until it returns False."""
        self._woken.append(mover)

    @abc.abstractmethod
    def add_box(self, size: Vector, centre: Vector) -> int:
        """A box (full edge lengths in metres) that stays where it is put; returns its handle."""

    @abc.abstractmethod
    def add_obstacle(self, box: Box) -> None:
        """A box that stands where it is, turned about its vertical axis, and that bodies hit."""

    @abc.abstractmethod
    def move_box(self, box: int, centre: Vector) -> None:
        """Put a box's centre at this place; it stays upright."""

    @abc.abstractmethod
    def remove_box(self, box: int) -> None:
        """Take a body away. Its handle may be given to a later body: do not use it again."""

    @abc.abstractmethod
    def close(self) -> None:
        """Free what the world holds. Closing twice changes nothing; a closed world cannot step."""

    @abc.abstractmethod
    def _advance(self) -> None:
        """One tick of physics, after the movers have moved."""

    def __enter__(self: _AnyWorld) -> _AnyWorld:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()
