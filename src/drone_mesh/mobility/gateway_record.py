"""The record of a gateway (`raspberry_gateway --record`): its answers to GET /mesh, one a line."""

from __future__ import annotations

import json
import reprlib
from typing import Any, Iterable, Iterator, Tuple, cast

from drone_mesh.arguments import MOST

Answer = Tuple[float, Any]
"""Seconds since the record began, which rise on after a restart of the gateway; and the answer."""

FIRST_BYTE = "{"  # of every line, and of no other file that is read in its place


def answers(lines: Iterable[str]) -> Iterator[Answer]:
    """Each answer, oldest first. Raises ValueError if there is none, or for one with wrong places.

    A line that was cut off, as by a power failure, is left out.
    """
    latest_s, start_s, found = 0.0, 0.0, False
    for number, line in enumerate(lines, start=1):
        try:
            answer = json.loads(line)
            uptime_s = answer["uptime_s"]
        except (ValueError, KeyError, TypeError, RecursionError):
            continue
        if not _is_number(uptime_s):
            continue
        try:
            list(places(answer))
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from error
        if start_s + uptime_s < latest_s:  # the gateway was started again
            start_s = latest_s
        latest_s, found = start_s + uptime_s, True
        yield latest_s, answer
    if not found:
        raise ValueError("no line is an answer to GET /mesh")


def places(answer: Any) -> Iterator[tuple[int, tuple[float, float, float]]]:
    """Each node with a known place, as x, y, z in metres. Raises ValueError for other content."""
    for node in _list_in(answer, "nodes"):
        try:
            number, place = node["id"], node["place"]
        except (KeyError, TypeError) as error:
            raise ValueError(
                f"expected nodes with id and place, not {reprlib.repr(node)}"
            ) from error
        if type(number) is not int:
            raise ValueError(f"the id of a node is {reprlib.repr(number)}")
        if place is not None:
            if not (isinstance(place, list) and len(place) == 3 and all(map(_is_number, place))):
                given = reprlib.repr(place)
                raise ValueError(f"node {number}: place {given} must be three numbers")
            latitude, longitude, height = map(float, place)
            yield number, (longitude, latitude, height)


def _list_in(answer: Any, key: str) -> list[Any]:
    found = answer.get(key)
    if not isinstance(found, list):
        raise ValueError(f"expected an answer to GET /mesh, with a list of {key}")
    return found


def _is_number(value: object) -> bool:
    return type(value) in (int, float) and -MOST <= cast(float, value) <= MOST
