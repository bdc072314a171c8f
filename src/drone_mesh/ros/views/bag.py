"""Reads states, events and packets of a mesh from a rosbag; writes states and events into one."""

from __future__ import annotations

from pathlib import Path
from typing import Iterable, Iterator

import rosbag
import rospy

from drone_mesh.console.dots import RecordedDots, make_dots
from drone_mesh.errors import MeshError
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
    with _open(path) as bag:
        for _topic, message, _time in bag.read_messages([_namespace(bag) + names.STATE_TOPIC]):
            yield mesh_status(message)


def read_events(path: Path) -> Iterator[EventRecord]:
    """Every event in the bag, oldest first. Raises BagUnusable."""
    with _open(path) as bag:
        for _topic, message, _time in bag.read_messages([_namespace(bag) + names.EVENTS_TOPIC]):
            yield event_record(message)


def read_packets(path: Path) -> Iterator[RecordedDots]:
    """Every sample of packets in the bag, oldest first. Raises BagUnusable."""
    with _open(path) as bag:
        for _topic, message, time in bag.read_messages([_namespace(bag) + names.PACKETS_TOPIC]):
            dots = make_dots(message.senders, message.receivers, message.types, message.ages)
            yield RecordedDots.of(time.to_sec(), message.carried, dots)


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


def _namespace(bag: rosbag.Bag) -> str:
    """The namespace of the mesh in the bag: the only one there is, or else our own."""
    end = f"/{names.STATE_TOPIC}"
    topics = bag.get_type_and_topic_info().topics
    found = [topic[: -len(names.STATE_TOPIC)] for topic in topics if topic.endswith(end)]
    return found[0] if len(found) == 1 else rospy.get_namespace()


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
