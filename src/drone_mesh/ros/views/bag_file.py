"""A bag as a file: what can be read of it, although parts are damaged.

rosbag itself ends at the first damage: at once if it is in an index, else at that message. But each
chunk has an index of its own and is read without those before it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Callable, Iterator, Sequence, TypeVar

import rosbag
import rospy

from drone_mesh.errors import MeshError
from drone_mesh.ros.graph import names

RECORDER = "'roslaunch drone_mesh record.launch'"
MOST_IN_CHUNK = 100_000  # a larger count is damaged, too
T = TypeVar("T")


class BagUnusable(MeshError):
    """A bag is missing, broken, or contains no mesh; the message says which."""


class BagDamaged(BagUnusable):
    """Parts of a recording cannot be read. Raised after everything readable was yielded."""


def open_bag(path: Path) -> rosbag.Bag:
    """The bag, with the indexes of the chunks whose index can be read. Raises BagUnusable."""
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


def messages(path: Path, topic: str, convert: Callable[[Any, float], T]) -> Iterator[T]:
    """Each message of the mesh on this topic as it came, converted with its time.

    Its time may go back: recorders go on when a simulation is started again.
    """
    with open_bag(path) as bag:
        full = namespace_in(bag) + topic
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
    raise_if_damaged(path, losses, f"on /{topic}")


def namespace_in(bag: rosbag.Bag) -> str:
    """The namespace of the mesh in the bag: the only one there is, or else our own."""
    end = f"/{names.STATE_TOPIC}"
    found = [topic[: -len(names.STATE_TOPIC)] for topic in topics_of(bag) if topic.endswith(end)]
    return found[0] if len(found) == 1 else rospy.get_namespace()


def topics_of(bag: rosbag.Bag) -> set[str]:
    """All its topics."""
    return {connection.topic for connection in bag._connections.values()}


def raise_if_damaged(path: Path, losses: Sequence[float], where: str) -> None:
    """Raises BagDamaged if messages of these times are lost."""
    if losses:
        until = f" to {max(losses):.1f} s" if max(losses) > min(losses) else ""
        raise BagDamaged(
            f"{path}: damaged at {min(losses):.1f} s{until}: {len(losses)} "
            f"{'message' if len(losses) == 1 else 'messages'} {where} cannot be read"
        )


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
        except Exception:  # as below
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
