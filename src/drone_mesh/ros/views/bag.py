"""Reads states, events and packets of a mesh from a rosbag; writes states and events into one.

The record of a gateway (`raspberry_gateway --record`) is read in the place of a bag.
"""

from __future__ import annotations

import codecs
import itertools
import math
import sys
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, Sequence, TypeVar

import rosbag

from drone_mesh.console.dots import RecordedDots, make_dots
from drone_mesh.console.gateway_client import events_of, origin_of, real_mesh
from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import MeshError
from drone_mesh.mobility.gateway_record import FIRST_BYTE, answers
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import (
    event_msg,
    event_record,
    mesh_status,
    ros_time,
    state_msg,
)
from drone_mesh.ros.views.bag_file import (
    RECORDER,
    BagDamaged,
    BagUnusable,
    messages,
    namespace_in,
    open_bag,
    raise_if_damaged,
    topics_of,
)
from drone_mesh.state.model import EventRecord, MeshStatus

EARLIEST_S = 1e-3  # a bag refuses a message with time 0
T = TypeVar("T")


def read_states(path: Path) -> Iterator[MeshStatus]:
    """Every state in the bag, oldest first. Raises BagUnusable."""
    if is_gateway_record(path):
        return _recorded(path, lambda answer: real_mesh(answer)[0])
    return messages(path, names.STATE_TOPIC, lambda message, _at_s: mesh_status(message))


def read_events(path: Path) -> Iterator[EventRecord]:
    """Every event in the bag, oldest first. Raises BagUnusable."""
    if is_gateway_record(path):
        return itertools.chain.from_iterable(_recorded(path, events_of))
    return messages(path, names.EVENTS_TOPIC, lambda message, _at_s: event_record(message))


def read_packets(path: Path) -> Iterator[RecordedDots]:
    """Every sample of packets in the bag, oldest first. Raises BagUnusable."""
    if is_gateway_record(path):
        return iter(())  # a gateway does not see the packets of others
    return messages(path, names.PACKETS_TOPIC, _dots)


def readable(items: Iterator[T], damage: list[BagDamaged]) -> Iterator[T]:
    """The items that can be read; the error that ends them is added to `damage`, not raised."""
    try:
        yield from items
    except BagDamaged as error:
        damage.append(error)


def raise_any(damage: Sequence[BagDamaged]) -> None:
    """Raise the first error, once a tool has shown what can be read."""
    if damage:
        raise damage[0]


def origin_in(path: Path) -> Origin | None:
    """Where the mesh of a gateway's record is on the earth; None: a bag does not say."""
    if not is_gateway_record(path):
        return None
    return next(filter(None, readable(_recorded(path, origin_of), [])), None)


def is_gateway_record(path: Path) -> bool:
    """Whether it is the record of a gateway; False for a file that cannot be read."""
    try:
        with path.open("rb") as file:
            begin = file.read(len(codecs.BOM_UTF8) + 1)
    except OSError:
        return False
    return begin.decode("utf-8-sig", "replace").startswith(FIRST_BYTE)


def by_run(states: Iterable[MeshStatus]) -> Iterator[tuple[int, MeshStatus]]:
    """Each state with the number of its run, from 1 on: time goes back where a run begins."""
    run, latest_s = 1, -math.inf
    for state in states:
        run += state.stamp_s < latest_s
        latest_s = state.stamp_s
        yield run, state


def chosen_run(path: Path, runs: int, given: int | None) -> int:
    """The run that was asked for; by default the last of several, which a line then says.

    Raises BagUnusable if there are not so many.
    """
    if given is not None and given > runs:
        raise BagUnusable(f"{path}: no run {given}; it contains {runs}")
    if given is None and runs > 1:
        print(
            f"{path}: contains {runs} runs, as its time goes back; this is the last one, "
            f"--run 1..{runs} takes another",
            file=sys.stderr,
        )
    return given or runs


def write_bag(path: Path, states: Iterable[MeshStatus], events: Iterable[EventRecord]) -> None:
    """Write a bag like record.launch's; states and events in any order. Raises BagUnusable."""
    try:
        with rosbag.Bag(str(path), "w") as bag:
            for status in states:
                at_s = max(EARLIEST_S, status.stamp_s)
                bag.write(f"/{names.STATE_TOPIC}", state_msg(status), ros_time(at_s))
            for event in events:
                at_s = max(EARLIEST_S, event.stamp_s)
                bag.write(f"/{names.EVENTS_TOPIC}", event_msg(event), ros_time(at_s))
    except OSError as error:
        raise BagUnusable(f"cannot write {path}: {error.strerror}") from error


def playable(path: Path, damage: list[BagDamaged]) -> Path:
    """A bag that rosbag can play: itself, or one made of a gateway's record, beside it.

    What is damaged in the record is left out and added to `damage`.
    """
    if not is_gateway_record(path):
        return path
    bag = path.with_name(f"{path.name}.bag")
    write_bag(bag, readable(read_states(path), damage), readable(read_events(path), damage))
    return bag


def topics_in_bag(path: Path) -> tuple[str, set[str]]:
    """The namespace of the mesh, which ends in a slash, and all topics. Raises BagUnusable."""
    with open_bag(path) as bag:
        topics = topics_of(bag)
        namespace = namespace_in(bag)
    if namespace + names.STATE_TOPIC not in topics:
        raise no_states(path)
    return namespace, topics


def no_states(path: Path) -> BagUnusable:
    """The error for a bag without states."""
    return BagUnusable(f"{path}: contains no /{names.STATE_TOPIC}, which {RECORDER} records")


def _dots(message: Any, at_s: float) -> RecordedDots:
    dots = make_dots(message.senders, message.receivers, message.types, message.ages)
    return RecordedDots.pack(at_s, message.carried, dots)


def _recorded(path: Path, convert: Callable[[dict[str, Any]], T]) -> Iterator[T]:
    """Each answer in the record of a gateway, converted, its times from the begin of the record."""
    losses: list[float] = []
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            for at_s, answer in answers(file):
                try:
                    later_s = at_s - answer["uptime_s"]
                    for event in answer["events"]:
                        event["t"] += later_s
                    found = convert({**answer, "uptime_s": at_s})
                except (AttributeError, KeyError, MeshError, TypeError, ValueError):
                    losses.append(at_s)
                else:
                    yield found
    except (OSError, ValueError) as error:
        raise BagUnusable(f"{path}: {error}") from error
    raise_if_damaged(path, losses, "of the record")
