"""World: time, and bodies without physics; and what a world with physics has besides."""

from __future__ import annotations

import abc
import itertools
from collections import deque
from typing import Protocol, TypeVar

from drone_mesh.air.obstacles import Box
from drone_mesh.drone.flight_path import Vector

_AnyWorld = TypeVar("_AnyWorld", bound="World")

TICKS_PER_S = 100  # steps and /clock per second of simulated time


class Mover(Protocol):
    """Something that is called in each step while it moves."""

    def step(self, now_s: float) -> bool:
        """Move on to `now_s`, in the world's thread; returns whether to call it again."""


class World:
    """Bodies and simulated time, which advances by one fixed tick per `step()`.

    Here a body is only its centre, which suffices for drones that follow their paths.

    Everything belongs to the thread that calls `step()`, except `wake()` and `now_s`, which any
    thread may use. Only movers that were woken cost time in a step. A world is a context manager
    that closes itself.
    """

    tick_s = 1.0 / TICKS_PER_S

    def __init__(self) -> None:
        self.centres: dict[int, Vector] = {}  # by handle
        self._handles = itertools.count()
        self._ticks = 0
        self._woken: deque[Mover] = deque()  # filled by any thread, emptied by the world's
        self._moving: dict[Mover, None] = {}  # an ordered set, so that runs are repeatable

    @property
    def now_s(self) -> float:
        """Simulated seconds since the start: counted in ticks, not summed, so there is no drift."""
        return self._ticks / TICKS_PER_S

    def step(self) -> float:
        """Advance one tick and all movers; returns the simulated seconds since the start."""
        self._ticks += 1
        now_s = self.now_s
        while self._woken:
            self._moving[self._woken.popleft()] = None
        for mover in [mover for mover in self._moving if not mover.step(now_s)]:
            del self._moving[mover]
        return now_s

    def wake(self, mover: Mover) -> None:
        """Call `mover` in each step from the next one on, until it returns False."""
        self._woken.append(mover)

    def add_box(self, _size: Vector, centre: Vector) -> int:
        """Add a box (full edge lengths, metres) that only `move_box` moves; returns its handle."""
        handle = next(self._handles)
        self.centres[handle] = centre
        return handle

    def add_obstacle(self, box: Box) -> None:
        """Add a fixed box that bodies collide with, turned about its vertical axis."""

    def move_box(self, box: int, centre: Vector) -> None:
        """Move a box's centre to this position; it stays upright."""
        self.centres[box] = centre

    def remove_box(self, box: int) -> None:
        """Remove a body. Its handle may be reused for a later body, so do not use it again."""
        del self.centres[box]

    def close(self) -> None:
        """Release the world's resources; a second call changes nothing. No steps after this."""

    def __enter__(self: _AnyWorld) -> _AnyWorld:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


class PhysicalWorld(World, abc.ABC):
    """A world with bodies that physics moves."""

    @abc.abstractmethod
    def add_body(self, size: Vector, centre: Vector, mass_kg: float) -> int:
        """A box that physics moves; it stays upright, as a drone's controller would keep it."""

    @abc.abstractmethod
    def body_state(self, body: int) -> tuple[Vector, Vector]:
        """Centre (m) and velocity (m/s) of a body, in the world frame."""

    @abc.abstractmethod
    def push(self, body: int, force: Vector, centre: Vector) -> None:
        """Newtons, world frame, at the centre, during the next step."""
