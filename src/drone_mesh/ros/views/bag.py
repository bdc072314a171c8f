"""Reads states, events and packets of a mesh from a rosbag; writes states and events into one.

The record of a gateway (`raspberry_gateway --record`) is read in the place of a bag.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Iterable, Iterator

import rosbag
import rospy

from drone_mesh.console.dots import RecordedDots, make_dots
from drone_mesh.console.real_mesh import events_of, origin_of, real_mesh
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
from drone_mesh.state.model import EventRecord, MeshStatus

EARLIEST_S = 1e-3  # a bag refuses a message with time 0
_RECORDER = "'roslaunch drone_mesh record.launch'"


class BagUnusable(MeshError):
    """A bag is missing, broken, or contains no mesh; the message says which."""


def read_states(path: Path) -> Iterator[MeshStatus]:
    """Every state in the bag, oldest first. Raises BagUnusable."""
    if is_gateway_record(path):
        yield from (real_mesh(answer)[0] for answer in _answers(path))
        return
    for message, _at_s in _messages(path, names.STATE_TOPIC):
        yield mesh_status(message)


def read_events(path: Path) -> Iterator[EventRecord]:
    """Every event in the bag, oldest first. Raises BagUnusable."""
    if is_gateway_record(path):
        for answer in _answers(path):
            yield from events_of(answer)
        return
    for message, _at_s in _messages(path, names.EVENTS_TOPIC):
        yield event_record(message)


def read_packets(path: Path) -> Iterator[RecordedDots]:
    """Every sample of packets in the bag, oldest first. Raises BagUnusable."""
    if is_gateway_record(path):
        return  # a gateway does not see the packets of others
    for message, at_s in _messages(path, names.PACKETS_TOPIC):
        dots = make_dots(message.senders, message.receivers, message.types, message.ages)
        yield RecordedDots.of(at_s, message.carried, dots)


def origin_in(path: Path) -> Origin | None:
    """Where the mesh of a gateway's record is on the earth; None: a bag does not say."""
    if not is_gateway_record(path):
        return None
    return next(filter(None, map(origin_of, _answers(path))), None)


def is_gateway_record(path: Path) -> bool:
    """Whether it is the record of a gateway; False for a file that cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(1) == FIRST_BYTE.encode()
    except OSError:
        return False


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


def playable(path: Path) -> Path:
    """A bag that rosbag can play: itself, or one made of a gateway's record, beside it."""
    if not is_gateway_record(path):
        return path
    bag = path.with_name(f"{path.name}.bag")
    write_bag(bag, read_states(path), read_events(path))
    return bag


def topics_in_bag(path: Path) -> tuple[str, set[str]]:
    """The namespace of the mesh, which ends in a slash, and all topics. Raises BagUnusable."""
    with _open(path) as bag:
        topics = set(bag.get_type_and_topic_info().topics)
        namespace = _namespace(bag)
    if namespace + names.STATE_TOPIC not in topics:
        raise no_states(path)
    return namespace, topics


def no_states(path: Path) -> BagUnusable:
    """The error for a bag without states."""
    return BagUnusable(f"{path}: contains no /{names.STATE_TOPIC}, which {_RECORDER} records")


def _messages(path: Path, topic: str) -> Iterator[tuple[Any, float]]:
    """Each message of the mesh on this topic, oldest first, and its time."""
    with _open(path) as bag:
        for _topic, message, time in bag.read_messages([_namespace(bag) + topic]):
            yield message, time.to_sec()


def _namespace(bag: rosbag.Bag) -> str:
    """The namespace of the mesh in the bag: the only one there is, or else our own."""
    end = f"/{names.STATE_TOPIC}"
    topics = bag.get_type_and_topic_info().topics
    found = [topic[: -len(names.STATE_TOPIC)] for topic in topics if topic.endswith(end)]
    return found[0] if len(found) == 1 else rospy.get_namespace()


def _answers(path: Path) -> Iterator[dict[str, Any]]:
    """Each answer, its times from the begin of the record."""
    try:
        with path.open(encoding="utf-8") as file:
            for at_s, answer in answers(file):
                later_s = at_s - answer["uptime_s"]
                for event in answer["events"]:
                    event["t"] += later_s
                yield {**answer, "uptime_s": at_s}
    except (KeyError, TypeError, ValueError) as error:
        raise BagUnusable(f"{path}: {error}") from error


def _open(path: Path) -> rosbag.Bag:
    try:
        return rosbag.Bag(str(path))
    except FileNotFoundError as error:
        raise BagUnusable(f"{path}: no such file; {_RECORDER} records one") from error
    except rosbag.ROSBagUnindexedException as error:
        raise BagUnusable(
            f"{path}: the recording was not closed; 'rosbag reindex {path}' repairs it"
        ) from error
    except OSError as error:
        raise BagUnusable(f"{path}: {error.strerror or error}") from error
    except (rosbag.ROSBagException, ValueError) as error:  # for arbitrary bytes
        raise BagUnusable(f"{path}: not a complete bag; {_RECORDER} records one") from error
