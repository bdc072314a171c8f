"""ConsoleMemory: what a console shows survives it, in a file: of one run, as much as a History."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sqlite3
import zlib
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, Iterator, Mapping, NamedTuple, Sequence

from drone_mesh.console.frame_store import EVENTS_KEPT, FrameStore
from drone_mesh.console.history import KeptState, unpacked
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.state.outages import MeshSample
from drone_mesh.web import LOOPBACK

# Of another version there may be other fields, and their order is all that the file knows.
_VERSION = " ".join(f.name for of in (MeshStatus, NodeStatus, MeshSample) for f in fields(of))
_TABLES = """
CREATE TABLE IF NOT EXISTS about (version TEXT, run TEXT, seen INTEGER, saved TEXT);
CREATE TABLE IF NOT EXISTS states (t REAL PRIMARY KEY, packed BLOB, sample TEXT);
CREATE TABLE IF NOT EXISTS events (t REAL, event TEXT);
"""
WAIT_S = 1.0  # for another program that has the file open
_DAMAGED = (KeyError, TypeError, ValueError, sqlite3.Error, zlib.error)

log = logging.getLogger(__name__)


def memory_of(address: str, port: int) -> Path | None:
    """The file of the console that listens there, which has it alone.

    None: port 0 is any port, or the user has no home.
    """
    home = os.environ.get("XDG_STATE_HOME", "")
    if not os.path.isabs(home):  # such a one is to be ignored: XDG Base Directory Specification
        home = os.path.expanduser("~/.local/state")
    if not port or not os.path.isabs(home):
        return None
    where = str(port) if address == LOOPBACK else f"{address.replace('/', '_')}-{port}"
    return Path(home, "drone_mesh", f"console-{where}.sqlite")


class Left(NamedTuple):
    """What a console left."""

    run: str
    seen: int
    saved: Mapping[str, Any]
    states: Sequence[KeptState]
    events: Sequence[EventRecord]

    @property
    def until_s(self) -> float:
        """When its last state was."""
        return self.states[-1].stamp_s if self.states else float("-inf")


class _News(NamedTuple):
    """What is not in the file yet."""

    run: str
    seen: int
    saved: str
    states: Sequence[KeptState]
    events: Sequence[EventRecord]
    begins_s: float  # older states and events are forgotten
    is_new: bool  # of another run than what is in the file


class ConsoleMemory:
    """`recall` and `collect` belong to the loop of the store, the rest to the main thread.

    `_unsaved` passes from one to the other. What cannot be read or written is said once, and the
    console goes on without it.
    """

    def __init__(self, store: FrameStore, path: Path | None) -> None:
        """Read what a console before this one has left; None: nothing is kept."""
        self._store, self._path = store, path
        self.seen = 0  # how many events of the run the feed has taken, for its next start
        self._left: Left | None = None
        self._run = ""
        self._is_new = True
        self._saved_s, self._events, self._noted = float("-inf"), 0, ""
        self._unsaved: list[_News] = []
        if path is not None:
            try:
                self._left = read_memory(path) if path.exists() else None
            except (OSError, sqlite3.OperationalError) as error:
                self._give_up(error)
            except _DAMAGED as error:
                log.warning("console: %s is ignored: %s", path, error)
                with contextlib.suppress(OSError):
                    path.unlink()

    def seen_in(self, run: str) -> int:
        """How many events of this run a console has taken."""
        return self._left.seen if self._left is not None and self._left.run == run else 0

    def recall(self, run: str) -> None:
        """The run is known: go on if the memory is of the same one, else forget what is shown."""
        history, left = self._store.history, self._left
        assert history is not None
        _count, early = history.events_after(0)  # they may come before the first state
        is_first, self._run, self._left = not self._run, run, None
        self._saved_s, self._events, self._is_new = float("-inf"), 0, True
        history.clear()
        self._store.restart(())
        if left is not None and run and left.run == run:
            try:
                history.restore(left.states)
                history.add_events(left.events)
                samples = history.samples_until(float("inf"))
                self._store.restore(left.saved, left.events[-EVENTS_KEPT:], samples)
                self._saved_s, self._events, self._is_new = left.until_s, len(left.events), False
            except _DAMAGED as error:
                log.warning("console: %s is ignored: %s", self._path, error)
                history.clear()
                self._store.restart(())
        if is_first:
            self._store.add_events(early)

    def collect(self) -> None:
        """Take what is worth saving now."""
        history = self._store.history
        if self._path is None or not self._run or history is None or not history.times:
            return
        states = history.states_after(self._saved_s)
        count, events = history.events_after(self._events)
        noted = json.dumps(self._store.saved())
        if not states and not events and noted == self._noted:
            return
        self._saved_s, self._events, self._noted = history.times[-1], count, noted
        begins_s, is_new, self._is_new = history.begins_s, self._is_new, False
        self._unsaved.append(
            _News(self._run, self.seen, noted, states, list(events), begins_s, is_new)
        )

    def save(self) -> None:
        while self._unsaved and self._path is not None:
            try:
                with _open(self._path) as database:
                    _write(database, self._unsaved.pop(0))
            except (OSError, sqlite3.Error) as error:
                self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        """Keep nothing; the file may be good, for a console that can open it."""
        reason = error.strerror if isinstance(error, OSError) else error
        log.warning("console: what the page shows is not kept: %s: %s", self._path, reason)
        self._path = None


@contextlib.contextmanager
def _open(path: Path) -> Iterator[sqlite3.Connection]:
    """The file, which only its owner may access, in one transaction."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    os.close(os.open(str(path), os.O_CREAT | os.O_RDWR, 0o600))
    with contextlib.closing(sqlite3.connect(str(path), timeout=WAIT_S)) as database:
        database.executescript(f"PRAGMA synchronous = OFF; {_TABLES}")  # the disk may take its time
        with database:
            yield database


def _write(database: sqlite3.Connection, news: _News) -> None:
    database.execute("DELETE FROM about")
    about = (_VERSION, news.run, news.seen, news.saved)
    database.execute("INSERT INTO about VALUES (?, ?, ?, ?)", about)
    for table in ("states", "events"):
        begins_s = float("inf") if news.is_new else news.begins_s
        database.execute(f"DELETE FROM {table} WHERE t < ?", (begins_s,))
    database.executemany(
        "INSERT OR REPLACE INTO states VALUES (?, ?, ?)",
        ((t, packed, json.dumps(astuple(sample))) for t, packed, sample in news.states),
    )
    database.executemany(
        "INSERT INTO events VALUES (?, ?)",
        ((event.stamp_s, json.dumps(astuple(event))) for event in news.events),
    )


def read_memory(path: Path) -> Left | None:
    """What is in such a file; None: nothing, or it is of another version.

    Raises KeyError, TypeError, ValueError or an error of sqlite3 or zlib if it is damaged.
    """
    with _open(path) as database:
        for version, run, seen, saved in database.execute("SELECT * FROM about"):
            if version != _VERSION:
                break
            rows = database.execute("SELECT * FROM states ORDER BY t")
            states = [KeptState(float(t), p, MeshSample(*json.loads(s))) for t, p, s in rows]
            for state in states[-1:]:
                unpacked(state.packed)
            rows = database.execute("SELECT event FROM events ORDER BY rowid")
            events = [_event(*json.loads(text)) for (text,) in rows]
            return Left(str(run), int(seen), dict(json.loads(saved)), states, events)
    return None


def _event(
    stamp_s: float,
    node: int,
    kind: str,
    peers: Sequence[int],
    detail: str,
    order: int,
    place: Sequence[float] | None,
) -> EventRecord:
    where = None if place is None else Location(*map(float, place))
    peers = tuple(map(int, peers))
    return EventRecord(float(stamp_s), int(node), str(kind), peers, str(detail), int(order), where)
