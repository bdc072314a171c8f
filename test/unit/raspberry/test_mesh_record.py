"""`raspberry_gateway --record`: what it writes, and what reads it again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from drone_mesh.console.gateway_client import events_of, real_mesh
from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.gateway_record import answers
from drone_mesh.mobility.trace_files import read_trace
from drone_mesh.raspberry.mesh_record import MeshRecord

NODE = {
    "id": 3,
    "role": "router",
    "on": True,
    "connected": True,
    "hops": 1,
    "next_hop": 0,
    "heard_s_ago": 0.5,
    "reported": True,
    "flying": True,
    "why_not_fly": "",
    "battery_percent": 80.0,
    "earth": None,
}


def answer(uptime_s: float, *place: float, events: list[dict[str, Any]] | None = None) -> Any:
    node = {**NODE, "place": list(place) or None}
    return {"gateway": 0, "uptime_s": uptime_s, "nodes": [node], "events": events or []}


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("id", None, "line 2: expected nodes with id and place, not {"),
        ("id", 1e400, "line 2: the id of a node is inf"),
        ("place", None, "line 2: expected nodes with id and place, not {"),
        ("place", [1, 2, 1e308], "line 2: node 3: place [1, 2, 1e+308] must be three numbers"),
        ("place", [1, 2, "x"], "line 2: node 3: place [1, 2, 'x'] must be three numbers"),
        ("place", "abc", "line 2: node 3: place 'abc' must be three numbers"),
    ],
)
def test_a_record_with_a_missing_or_wrong_value_is_refused_in_one_line(tmp_path, key, value, why):
    wrong = answer(2.0, 1.0, 2.0, 3.0)
    del wrong["nodes"][0][key]
    if value is not None:
        wrong["nodes"][0][key] = value
    lines = [json.dumps(answer(1.0, 1.0, 2.0, 3.0)), json.dumps(wrong)]
    path = tmp_path / "flight.jsonl"
    path.write_text("\n".join(lines))
    with pytest.raises(ConfigurationError) as caught:
        read_trace(path)
    assert why in str(caught.value)


def test_lines_that_are_no_answers_are_left_out(tmp_path):
    path = tmp_path / "flight.jsonl"
    others = ['{"uptime_s": 1e400}', '{"uptime_s": "1"}', "[" * 5000, "{}", '{"uptime_s": 2, "no']
    path.write_text("\ufeff" + "\n".join([json.dumps(answer(1.0, 1.0, 2.0, 3.0)), *others]))
    assert read_trace(path) == {3: [(1.0, 2.0, 1.0, 3.0)]}


class Gateway:
    """Answers at once; an event a second."""

    def __init__(self) -> None:
        self.uptime_s = 0.0
        self.asked: list[int] = []

    def submit(self, work) -> None:
        work(self.uptime_s)

    def mesh(self, after: int) -> dict[str, Any]:
        self.asked.append(after)
        number = int(self.uptime_s) + 1
        event = {"number": number, "t": 0.0, "node": 3, "kind": "lost", "peers": [], "detail": ""}
        return answer(self.uptime_s, 2.0, 1.0, 5.0 + self.uptime_s, events=[event])


def write(path: Path, *all_answers: Any) -> None:
    path.write_text("".join(json.dumps(each) + "\n" for each in all_answers))


def test_once_a_second_state_and_new_events_are_appended(tmp_path: Path) -> None:
    file = tmp_path / "flight.jsonl"
    gateway = Gateway()
    record = MeshRecord(file, gateway.submit, gateway.mesh)
    for half_s in range(7):
        gateway.uptime_s = half_s / 2
        record.check(100.0 + half_s / 2)
    record.close()
    assert gateway.asked == [0, 1, 2, 3]  # each event once
    lines = file.read_text().splitlines()
    assert [json.loads(line)["uptime_s"] for line in lines] == [0.0, 1.0, 2.0, 3.0]
    gateway.uptime_s = 0.5  # it was started again
    again = MeshRecord(file, gateway.submit, gateway.mesh)
    again.check(0.0)
    again.close()
    assert [at_s for at_s, _answer in answers(file.read_text().splitlines())][-1] == 3.5


def test_a_full_disk_ends_the_record_and_not_the_gateway(caplog) -> None:
    gateway = Gateway()
    record = MeshRecord(Path("/dev/full"), gateway.submit, gateway.mesh)
    for second in range(5):
        record.check(float(second))
    record.close()
    assert [r.getMessage() for r in caplog.records] == [
        "--record /dev/full ends: No space left on device"
    ]
    assert len(gateway.asked) == 1


def test_a_file_that_cannot_be_written_is_named_at_the_start(tmp_path: Path) -> None:
    gateway = Gateway()
    with pytest.raises(ConfigurationError, match="--record .*/no/such: No such file or directory"):
        MeshRecord(tmp_path / "no" / "such", gateway.submit, gateway.mesh)


def test_an_experiment_flies_along_the_reported_places(tmp_path: Path) -> None:
    file = tmp_path / "flight.jsonl"
    write(
        file,
        answer(1.0),
        answer(2.0, 10.0, 20.0, 5.0),
        answer(3.0, 10.0, 20.0, 5.0),
        answer(32.0, 10.0, 50.0, 5.0),
        answer(0.0, 10.0, 55.0, 5.0),  # the gateway was started again
        answer(4.0, 10.0, 60.0, 5.0),
    )
    assert read_trace(file) == {
        3: [(2.0, 20.0, 10.0, 5.0), (32.0, 50.0, 10.0, 5.0), (36.0, 60.0, 10.0, 5.0)]
    }


def test_a_line_that_a_power_failure_cut_is_left_out_and_another_file_is_refused(
    tmp_path: Path,
) -> None:
    whole = json.dumps(answer(1.0, 1.0, 2.0, 3.0))
    assert [t for t, _ in answers([whole, whole[:40], whole])] == [1.0, 1.0]
    file = tmp_path / "other.jsonl"
    for content in ("{}", '{"uptime_s": 3.0}'):
        file.write_text(content)
        with pytest.raises(ConfigurationError, match="answer to GET /mesh"):
            read_trace(file)


def test_an_answer_becomes_a_state_and_its_events() -> None:
    event = {"number": 1, "t": 2.5, "node": 3, "kind": "took off", "peers": [], "detail": ""}
    mesh, _more = real_mesh(answer(4.0, 10.0, 20.0, 5.0, events=[event]))
    assert mesh.stamp_s == 4.0
    assert tuple(mesh.nodes[0].position) == (20.0, 10.0, 5.0)
    assert events_of(answer(4.0, events=[event]))[0].kind == "took off"
