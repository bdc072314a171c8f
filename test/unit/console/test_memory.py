"""What a console shows survives it, in a file."""

from __future__ import annotations

import contextlib
import json
import os
import pwd
import sqlite3
import stat
from pathlib import Path

import pytest

from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History
from drone_mesh.console.memory import ConsoleMemory, memory_of
from drone_mesh.drone.location import Location
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus
from drone_mesh.web import LOOPBACK

EVENTS = [
    EventRecord(1.0, 3, "connected", (0,)),
    EventRecord(2.5, 0, "order sent", (3,), order=7, place=Location(1.0, 2.0, 3.0)),
    EventRecord(2.9, 3, "disconnected", (0,)),
]


class Console:
    """One that remembers in this file, and what it shows."""

    def __init__(self, path: Path | None, run: str = "a1b2") -> None:
        self.store = FrameStore(History())
        self.memory = ConsoleMemory(self.store, path)
        self.memory.recall(run)

    def update(self, at_s: float, *, connected: bool = True) -> None:
        nodes = [NodeStatus(0, role=1), NodeStatus(3, connected=connected, neighbours=b"\0")]
        self.store.update_mesh(MeshStatus(at_s, nodes), wall_s=at_s)

    def save(self) -> None:
        self.memory.collect()
        self.memory.save()

    @property
    def frame(self) -> dict:
        shown: dict = json.loads(self.store.frame_since(0))
        return {name: shown.get(name, []) for name in ("events", "alarms", "samples")}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file in which a console has remembered three seconds, after each of which it saved."""
    file = tmp_path / "state" / "console.sqlite"
    console = Console(file)
    for second, event in enumerate(EVENTS, start=1):
        console.update(float(second), connected=second < 3)
        console.store.add_events([event])
        console.memory.seen = second
        console.save()
    assert console.store.acknowledge("no gateway") or console.frame["alarms"]
    console.save()
    return file


def test_a_console_of_the_same_run_shows_what_the_one_before_it_has_shown(path):
    before, again = Console(None), Console(path)
    for second, event in enumerate(EVENTS, start=1):
        before.update(float(second), connected=second < 3)
        before.store.add_events([event])
    assert again.frame["events"] == before.frame["events"]
    assert [alarm["text"] for alarm in again.frame["alarms"]] == [
        alarm["text"] for alarm in before.frame["alarms"]
    ]
    assert [sample["stamp_s"] for sample in again.frame["samples"]] == [1.0, 2.0, 3.0]
    history = again.store.history
    assert history is not None
    assert history.times == [1.0, 2.0, 3.0]
    assert history.state(0).nodes[1].neighbours == b"\0"
    assert list(history.events_until(9.0)) == EVENTS
    again.update(4.0)
    assert "order 7 to x 2.00 m" in json.loads(again.store.frame_since(0))["nodes"]["3"]["order"]


def test_it_goes_on_in_the_same_file_and_says_how_many_events_it_has_taken(path):
    store = FrameStore(History())
    memory = ConsoleMemory(store, path)
    assert (memory.seen_in("a1b2"), memory.seen_in("another")) == (3, 0)
    again = Console(path)
    again.update(4.0)
    again.store.add_events([EventRecord(4.0, 3, "connected", (0,))])
    again.save()
    third = Console(path)
    assert third.store.history is not None
    assert third.store.history.times == [1.0, 2.0, 3.0, 4.0]
    assert [event["t"] for event in third.frame["events"]] == [1.0, 2.5, 2.9, 4.0]


def test_what_another_run_has_left_is_neither_shown_nor_kept(path):
    other = Console(path, "another")
    assert other.frame == {"events": [], "alarms": [], "samples": []}
    other.update(0.5)
    other.save()
    again = Console(path, "another")
    assert again.store.history is not None
    assert again.store.history.times == [0.5]
    assert Console(path).frame["events"] == []


def test_events_from_before_the_first_state_stay_when_more_is_saved(tmp_path):
    console = Console(tmp_path / "console.sqlite")
    console.store.add_events([EventRecord(0.5, 3, "connected", (0,))])
    for second in (1.0, 2.0):
        console.update(second)
        console.save()
    assert [event["t"] for event in Console(tmp_path / "console.sqlite").frame["events"]] == [0.5]


def test_events_that_come_before_the_first_state_are_shown(path):
    store = FrameStore(History())
    memory = ConsoleMemory(store, path)
    store.add_events([EventRecord(4.0, 3, "landed")])
    memory.recall("a1b2")
    shown = json.loads(store.frame_since(0))["events"]
    assert [event["kind"] for event in shown][-2:] == ["disconnected", "landed"]


def test_the_file_keeps_as_much_as_the_history(tmp_path):
    file = tmp_path / "console.sqlite"
    console = Console(file)
    for second in range(1, 2000, 100):
        console.update(float(second))
        console.save()
    again = Console(file)
    assert again.store.history is not None
    assert console.store.history is not None
    assert again.store.history.times == console.store.history.times
    assert again.store.history.times[0] > 1.0


def test_only_its_owner_can_read_it(path):
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE about SET saved = '{'",
        "UPDATE about SET saved = '[3]'",
        "UPDATE about SET saved = '{}'",
        "UPDATE about SET version = 'older'",
        "UPDATE states SET packed = x'00'",
        "UPDATE states SET sample = 'null'",
        "UPDATE events SET event = '[1]'",
        "DROP TABLE about",
        "",
    ],
)
def test_a_damaged_file_or_one_of_another_version_is_begun_anew(path, damage):
    if damage:
        with sqlite3.connect(str(path)) as database:
            database.execute(damage)
        database.close()
    else:
        path.write_bytes(path.read_bytes()[:5000] + b"no database")
    console = Console(path)
    assert console.frame == {"events": [], "alarms": [], "samples": []}
    console.update(9.0)
    console.save()
    again = Console(path)
    assert again.store.history is not None
    assert again.store.history.times == [9.0]


@pytest.mark.parametrize("part", ["alarms", "orders"])
@pytest.mark.parametrize("damage", [None, 3, [3], [{}], [["x"]]])
def test_a_store_takes_no_damaged_memory(part, damage):
    with pytest.raises((KeyError, TypeError, ValueError)):
        FrameStore().restore({**FrameStore().saved(), part: damage}, [], [])


def test_a_place_that_cannot_be_written_is_said_once_and_nothing_is_kept(tmp_path, caplog):
    (tmp_path / "file").write_text("")
    console = Console(tmp_path / "file" / "console.sqlite")
    for second in (1.0, 2.0):
        console.update(second)
        console.save()
    assert [record.levelname for record in caplog.records] == ["WARNING"]


@pytest.mark.parametrize("asked", ["open", "stat"])
def test_a_file_that_cannot_be_opened_is_said_and_left_alone(path, caplog, monkeypatch, asked):
    def refuse(*_about: object, **_more: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(os, asked, refuse)
        patch.setattr(Path, "exists", lambda file: bool(os.stat(str(file))))
        console = Console(path)
        console.update(9.0)
        console.save()
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert len(Console(path).frame["events"]) == len(EVENTS)


def test_a_file_that_another_console_uses_is_left_alone(path, caplog, monkeypatch):
    monkeypatch.setattr("drone_mesh.console.memory.WAIT_S", 0.01)
    with contextlib.closing(sqlite3.connect(str(path))) as other:
        other.execute("BEGIN EXCLUSIVE")
        console = Console(path)
        console.update(9.0)
        console.save()
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert len(Console(path).frame["events"]) == len(EVENTS)


@pytest.mark.parametrize("home", ["", "relative/state"])
def test_without_an_absolute_folder_in_the_environment_it_is_the_one_of_the_user(monkeypatch, home):
    monkeypatch.setenv("XDG_STATE_HOME", home)
    monkeypatch.setenv("HOME", "/home/somebody")
    assert memory_of(LOOPBACK, 1) == Path("/home/somebody/.local/state/drone_mesh/console-1.sqlite")


def test_a_user_without_a_home_keeps_nothing(monkeypatch):
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    monkeypatch.delenv("HOME")
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    assert memory_of(LOOPBACK, 8080) is None


def test_a_console_on_any_free_port_keeps_nothing():
    assert memory_of(LOOPBACK, 0) is None


def test_consoles_on_one_port_of_two_addresses_have_files_of_their_own(monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert memory_of(LOOPBACK, 8080) == Path("/state/drone_mesh/console-8080.sqlite")
    assert memory_of("::1", 8080) == Path("/state/drone_mesh/console-::1-8080.sqlite")
    assert memory_of("a/../b", 8080) == Path("/state/drone_mesh/console-a_.._b-8080.sqlite")
