"""Recordings: bags, and the records of gateways (`raspberry_gateway --record`) in their place.

rosbag itself ends at the first damage: at once if it is in an index, else at that message. But each
chunk has an index of its own and is read without those before it.
"""

from __future__ import annotations

import codecs
import itertools
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, Sequence, TypeVar

import rospy

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
from drone_mesh.state.model import EventRecord, MeshStatus

if TYPE_CHECKING:
    import rosbag  # otherwise only for who reads one: it loads ciphers and compression

RECORDER = "'roslaunch drone_mesh record.launch'"
EARLIEST_S = 1e-3  # a bag refuses a message with time 0
MOST_IN_CHUNK = 100_000  # a larger count is damaged, too
T = TypeVar("T")


class BagUnusable(MeshError):
    """A recording is missing, broken, or contains no mesh; the message says which."""


class RecordedMesh:
    """Reads a recording, oldest first. What is damaged is left out and told by `raise_damage`.

    All functions raise BagUnusable.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage: list[BagUnusable] = []
        self._of_gateway = _is_gateway_record(path)

    def states(self) -> Iterator[MeshStatus]:
        if self._of_gateway:
            return self._answers(lambda answer: real_mesh(answer)[0])
        return self._messages(names.STATE_TOPIC, lambda message, _at_s: mesh_status(message))

    def events(self) -> Iterator[EventRecord]:
        if self._of_gateway:
            return itertools.chain.from_iterable(self._answers(events_of))
        return self._messages(names.EVENTS_TOPIC, lambda message, _at_s: event_record(message))

    def packets(self) -> Iterator[RecordedDots]:
        """Every sample of packets; none in a record, as a gateway does not see those of others."""
        return iter(()) if self._of_gateway else self._messages(names.PACKETS_TOPIC, _dots)

    def origin(self) -> Origin | None:
        """Where the mesh of a gateway's record is on the earth; None: a bag does not say."""
        return next(filter(None, self._answers(origin_of)), None) if self._of_gateway else None

    def by_run(self) -> Iterator[tuple[int, MeshStatus]]:
        """Each state with the number of its run, from 1 on: time goes back where a run begins."""
        run, latest_s = 0, math.inf
        for state in self.states():
            run += state.stamp_s < latest_s if run else 1
            latest_s = state.stamp_s
            yield run, state
        if not run:
            self.raise_damage()
            raise self._no_states()

    def chosen_run(self, runs: int, given: int | None) -> int:
        """The run that was asked for; by default the last of several, which a line then says."""
        if given is not None and given > runs:
            raise BagUnusable(f"{self.path}: no run {given}; it contains {runs}")
        if given is None and runs > 1:
            print(
                f"{self.path}: contains {runs} runs, as its time goes back; this is the last one, "
                f"--run 1..{runs} takes another",
                file=sys.stderr,
            )
        return given or runs

    def raise_damage(self) -> None:
        """Raise the first error, once a tool has shown what can be read."""
        if self.damage:
            raise self.damage[0]

    def playable(self) -> Path:
        """A bag that rosbag can play: itself, or one made of a gateway's record, beside it."""
        if not self._of_gateway:
            return self.path
        bag = self.path.with_name(f"{self.path.name}.bag")
        write_bag(bag, self.states(), self.events())
        return bag

    def topics(self) -> tuple[str, set[str]]:
        """Of a bag: the namespace of the mesh, which ends in a slash, and all topics."""
        with _open_bag(self.path) as bag:
            namespace, topics = _namespace_in(bag), _topics_of(bag)
        if namespace + names.STATE_TOPIC not in topics:
            raise self._no_states()
        return namespace, topics

    def _no_states(self) -> BagUnusable:
        return BagUnusable(
            f"{self.path}: contains no /{names.STATE_TOPIC}, which {RECORDER} records"
        )

    def _messages(self, topic: str, convert: Callable[[Any, float], T]) -> Iterator[T]:
        """Each message of the mesh on this topic as it came, converted with its time.

        Its time may go back: recorders go on when a simulation is started again.
        """
        with _open_bag(self.path) as bag:
            full = _namespace_in(bag) + topic
            numbers = {number for number, one in bag._connections.items() if one.topic == full}
            entries = [entry for number in numbers for entry in bag._connection_indexes[number]]
            losses = _not_indexed(bag, numbers, {entry.chunk_pos for entry in entries})
            for entry in sorted(entries, key=lambda entry: entry.position):
                try:
                    _topic, message, time = bag._read_message(entry.position)
                    if time != entry.time:
                        raise ValueError("its time is damaged, here or in the index")
                    found = convert(message, time.to_sec())
                except Exception:  # of rosbag, genpy and compression, for arbitrary bytes
                    losses.append(entry.time.to_sec())
                else:
                    yield found
        self._note_losses(losses, f"on /{topic}")

    def _answers(self, convert: Callable[[dict[str, Any]], T]) -> Iterator[T]:
        """Each answer in the record of a gateway, converted, its times from the record's begin."""
        losses: list[float] = []
        try:
            with self.path.open(encoding="utf-8-sig", errors="replace") as file:
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
            raise BagUnusable(f"{self.path}: {error}") from error
        self._note_losses(losses, "of the record")

    def _note_losses(self, losses: Sequence[float], where: str) -> None:
        """`losses`: the times of messages that are lost."""
        if losses:
            until = f" to {max(losses):.1f} s" if max(losses) > min(losses) else ""
            text = (
                f"{self.path}: damaged at {min(losses):.1f} s{until}: {len(losses)} "
                f"{'message' if len(losses) == 1 else 'messages'} {where} cannot be read"
            )
            self.damage.append(BagUnusable(text))


def write_bag(path: Path, states: Iterable[MeshStatus], events: Iterable[EventRecord]) -> None:
    """Write a bag like record.launch's; states and events in any order. Raises BagUnusable."""
    import rosbag

    try:
        with rosbag.Bag(str(path), "w") as bag:
            for status in states:
                at = ros_time(max(EARLIEST_S, status.stamp_s))
                bag.write(f"/{names.STATE_TOPIC}", state_msg(status), at)
            for event in events:
                at = ros_time(max(EARLIEST_S, event.stamp_s))
                bag.write(f"/{names.EVENTS_TOPIC}", event_msg(event), at)
    except OSError as error:
        raise BagUnusable(f"cannot write {path}: {error.strerror}") from error


def _is_gateway_record(path: Path) -> bool:
    """Whether it is the record of a gateway; False for a file that cannot be read."""
    try:
        with path.open("rb") as file:
            begin = file.read(len(codecs.BOM_UTF8) + 1)
    except OSError:
        return False
    return begin.decode("utf-8-sig", "replace").startswith(FIRST_BYTE)


def _dots(message: Any, at_s: float) -> RecordedDots:
    dots = make_dots(message.senders, message.receivers, message.types, message.ages)
    return RecordedDots.pack(at_s, message.carried, dots)


def _open_bag(path: Path) -> rosbag.Bag:
    """The bag, with the indexes of the chunks whose index can be read. Raises BagUnusable."""
    import rosbag

    try:
        try:
            return rosbag.Bag(str(path))
        except rosbag.ROSBagUnindexedException:
            return _indexed_again(rosbag.Bag(str(path), allow_unindexed=True), path)
    except FileNotFoundError as error:
        raise BagUnusable(f"{path}: no such file; {RECORDER} records one") from error
    except OSError as error:
        raise BagUnusable(f"{path}: {error.strerror or error}") from error
    except (rosbag.ROSBagException, ValueError) as error:  # for arbitrary bytes
        raise BagUnusable(f"{path}: not a complete bag; {RECORDER} records one") from error


def _topics_of(bag: rosbag.Bag) -> set[str]:
    return {connection.topic for connection in bag._connections.values()}


def _namespace_in(bag: rosbag.Bag) -> str:
    """The namespace of the mesh in the bag: the only one there is, or else our own."""
    end = f"/{names.STATE_TOPIC}"
    found = [topic[: 1 - len(end)] for topic in _topics_of(bag) if topic.endswith(end)]
    return found[0] if len(found) == 1 else rospy.get_namespace()


def _indexed_again(bag: rosbag.Bag, path: Path) -> rosbag.Bag:
    """The bag, with the index of each chunk that has a readable one. Raises BagUnusable."""
    if not bag._chunks:
        bag.close()
        raise BagUnusable(
            f"{path}: the recording was not closed; 'rosbag reindex {path}' repairs it"
        )
    bag._connection_indexes = {number: [] for number in bag._connections}
    for chunk in bag._chunks:
        try:
            bag._file.seek(chunk.pos)
            header = bag._chunk_headers[chunk.pos] = bag._reader.read_chunk_header()
            bag._file.seek(header.data_pos + header.compressed_size)
            bag._curr_chunk_info = chunk
            for _connection in chunk.connection_counts:
                number, entries = bag._reader.read_connection_index_record()
                bag._connection_indexes[number].extend(entries)
        except Exception:  # as above
            continue
    return bag


def _not_indexed(bag: rosbag.Bag, numbers: set[int], indexed: set[int]) -> list[float]:
    """A time for each message of these connections in a chunk that is not among `indexed`."""
    return [
        chunk.start_time.to_sec()
        for chunk in bag._chunks
        if chunk.pos not in indexed
        for number in numbers
        for _message in range(min(chunk.connection_counts.get(number, 0), MOST_IN_CHUNK))
    ]
