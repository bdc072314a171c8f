"""BonnMotion's own files: a line for each drone, which lists its times and places."""

from __future__ import annotations

from typing import Iterable, Iterator, List, Tuple

from drone_mesh.mobility.knots import Knots, follows, number_in
from drone_mesh.mobility.settings import Knot

_COLUMNS = {"#2D": 3, "#3D": 4}  # BonnMotion itself writes #3D only

_Line = Tuple[int, List[float]]  # its number in the file, and the numbers in it


def read_bonnmotion(lines: Iterable[str]) -> Knots:
    """The k-th line that is no comment is drone k. Raises ValueError, which names the line.

    Without a line #2D or #3D the times tell which it is, as they rise in each line.
    """
    drones: list[_Line] = []
    readings = sorted(_COLUMNS.values())
    for number, line in enumerate(lines, start=1):
        if line.strip() in _COLUMNS:
            readings = [_COLUMNS[line.strip()]]
        elif line.strip() and not line.startswith("#"):
            drones.append((number, [number_in(word, number) for word in line.split()]))
    if not drones:
        return {}
    for number, numbers in drones:
        if not any(_is_track(numbers, columns) for columns in readings):
            wanted = " or ".join("t x y z"[: 2 * columns - 1] for columns in readings)
            raise ValueError(f"line {number}: expected {wanted} again and again, with rising t")
    fit = [c for c in readings if all(_is_track(numbers, c) for _number, numbers in drones)]
    if len(fit) != 1:
        both = "fits both t x y and t x y z" if fit else "has lines of t x y and lines of t x y z"
        raise ValueError(f"{both}: say which it is in a first line #2D or #3D")
    return {node: list(_knots(numbers, fit[0])) for node, (_number, numbers) in enumerate(drones)}


def _is_track(numbers: list[float], columns: int) -> bool:
    if len(numbers) % columns:
        return False
    knots = list(_knots(numbers, columns))
    return all(follows(b, a) for a, b in zip(knots, knots[1:]))


def _knots(numbers: list[float], columns: int) -> Iterator[Knot]:
    for first in range(0, len(numbers), columns):
        t, x, y, *z = numbers[first : first + columns]
        yield t, x, y, z[0] if z else 0.0
