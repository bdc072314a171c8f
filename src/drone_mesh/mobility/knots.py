"""Knots: the times and places that a recorded motion is made of."""

from __future__ import annotations

from typing import Dict, List

from drone_mesh.arguments import finite
from drone_mesh.mobility.settings import Knot

Knots = Dict[int, List[Knot]]  # by drone, in order of time


def number_in(text: str, line: int, name: str = "") -> float:
    """The number called `name` in this line. Raises ValueError, also for one above 1e9."""
    try:
        return finite(text)
    except ValueError:
        given = f"{name} {text}".strip()
        raise ValueError(f"line {line}: expected numbers, not {given[:60]}") from None


def follows(knot: Knot, before: Knot) -> bool:
    """Whether this place can follow: its time is later, or equal at an equal place."""
    return knot[0] > before[0] or knot == before
