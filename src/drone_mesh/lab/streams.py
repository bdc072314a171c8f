"""Random numbers by purpose: the draws of one part do not shift those of another."""

from __future__ import annotations

import random


class Streams:
    """The random generators of one run.

    The r-th repetition has the same streams in every cell of an experiment (common random numbers):
    the same layout, victims and losses, whatever the technique under test draws.
    """

    def __init__(self, seed: int, repetition: int) -> None:
        self._root = f"{seed}/{repetition}"

    def generator(self, purpose: str) -> random.Random:
        """A generator for this purpose; equal for equal seed, repetition and purpose."""
        return random.Random(f"{self._root}/{purpose}")  # seeded by SHA-512, equal in each Python

    def number(self, purpose: str) -> int:
        """A 32-bit seed for a part that wants a number."""
        return self.generator(purpose).getrandbits(32)
