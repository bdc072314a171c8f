"""The record of a gateway (`raspberry_gateway --record`): its answers to GET /mesh, one a line."""

from __future__ import annotations

import json
import math
from typing import Any, Iterable, Iterator, Tuple

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
            uptime_s = _number(answer["uptime_s"])
        except (ValueError, KeyError, TypeError, RecursionError):
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
    try:
        for node in answer["nodes"]:
            if node["place"] is not None:
                latitude, longitude, height = map(_number, node["place"])
                yield int(_number(node["id"])), (longitude, latitude, height)
    except (KeyError, TypeError) as error:
        raise ValueError("expected an answer to GET /mesh") from error
    except ValueError as error:
        raise ValueError(
            f"node {node['id']}: place {node['place']} must be three numbers"
        ) from error


def _number(value: Any) -> float:
    """Raises ValueError for what JSON of others may have in its place, NaN included."""
    if type(value) not in (int, float) or not abs(value) < math.inf:
        raise ValueError(f"{value!r:.40} is not a number")
    return float(value)
