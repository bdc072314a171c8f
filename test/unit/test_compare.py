"""scripts/compare and scripts/bench growth: what they hand to others, and what they refuse."""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from drone_mesh.mobility.trace_files import read_trace

ROOT = Path(__file__).resolve().parents[2]
NS3_MODULES = [
    "aodv",
    "applications",
    "core",
    "dsdv",
    "internet",
    "mobility",
    "network",
    "olsr",
    "wifi",
]


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "scripts")
    module = importlib.import_module("compare")
    monkeypatch.setattr(module, "BUILD", tmp_path)
    return module


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "required: scenario"),
        (["tie"], "invalid choice"),
        (["speed", "--traces", "0"], "--traces"),
    ],
)
def test_what_it_does_not_know_is_refused_before_anything_runs(
    compare: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.setattr(sys, "argv", ["compare.py", *arguments])
    with pytest.raises(SystemExit) as ended:
        compare.main()
    assert ended.value.code == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_ns3_gets_each_place_of_a_trace_and_each_time_once(
    compare: ModuleType, tmp_path: Path
) -> None:
    trace = tmp_path / "two.bonnmotion"
    trace.write_text("#2D\n0 1 2 5 3 4 5 3 4 7 3 9\n2 8 8\n")
    assert list(compare.waypoints(read_trace(trace))) == [
        "w 0 0.000000 1.000000 2.000000",
        "w 0 5.000000 3.000000 4.000000",
        "w 0 7.000000 3.000000 9.000000",
        "w 1 2.000000 8.000000 8.000000",
    ]


@pytest.mark.parametrize("name", ["motion", "speed"])
def test_a_drawn_trace_lasts_to_the_end_within_the_area_and_the_speed(
    compare: ModuleType, tmp_path: Path, name: str
) -> None:
    scenario, trace = compare.SCENARIOS[name], tmp_path / "drawn.bonnmotion"
    trace.write_text(compare.drawn(scenario, seed=3))
    assert trace.read_text() == compare.drawn(scenario, seed=3) != compare.drawn(scenario, seed=4)
    job = compare.Job(scenario, read_trace(trace), 3)
    assert sorted(job.knots) == list(range(scenario.nodes))
    for places in job.knots.values():
        assert places[0][0] == 0.0
        assert places[-1][0] >= scenario.until_s
    for track in job.tracks().values():
        for second in range(0, int(scenario.until_s), 10):
            (x, y, _z), (u, v, _w) = track.position_at(second), track.velocity_at(second)
            assert 0 <= x <= scenario.area.width_m
            assert 0 <= y <= scenario.area.depth_m
            assert (u * u + v * v) ** 0.5 <= scenario.speed_m_s[1] + 0.01


def test_messages_on_the_disc_arrive_in_the_small_scenario(
    compare: ModuleType, tmp_path: Path
) -> None:
    scenario = compare.SCENARIOS["speed"]._replace(nodes=30, until_s=40.0)
    trace = tmp_path / "drawn.bonnmotion"
    trace.write_text(compare.drawn(scenario._replace(area=compare.Area(0, 0, 20, 20)), seed=1))
    job = compare.Job(scenario, read_trace(trace), 1)
    degree, reachable = job.degree_and_reachable()
    assert degree > 5
    assert reachable > 0.9
    outcome = compare.drone_mesh(job, "beacon", "disc")
    assert len(outcome.delays_s) >= 0.9 * reachable * len(scenario.messages())
    assert all(0 < delay_s < 1 for delay_s in outcome.delays_s)


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/usr/include/ns3").is_dir() or shutil.which("g++") is None,
    reason="needs ns-3 and a compiler: apt-get install g++ libns3-dev",
)
def test_the_radio_of_ns3_ends_at_the_range_that_the_others_get(
    compare: ModuleType, tmp_path: Path
) -> None:
    libraries = [f"-lns3-{module}" for module in NS3_MODULES]
    program = ["g++", "-O1", "-std=c++17", "-o", tmp_path / "compare_ns3"]
    subprocess.run([*program, ROOT / "scripts" / "compare_ns3.cc", *libraries], check=True)
    scenario = compare.SCENARIOS["motion"]._replace(flows=[(1, 0)], until_s=110.0)
    for away_m, arrives in ((135.0, True), (140.0, False)):
        knots = {0: [(0.0, 0.0, 0.0, 0.0)], 1: [(0.0, away_m, 0.0, 0.0)]}
        outcome = compare.ns3(compare.Job(scenario, knots, 1), "OLSR", "")
        sent = len(scenario.messages())
        assert len(outcome.delays_s) == (sent if arrives else 0)
        assert outcome.frames > 0


def test_growth_measures_all_arms_and_draws_them(
    compare: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    growth = importlib.import_module("growth")
    monkeypatch.setattr(growth, "PICTURE", tmp_path / "growth.svg")
    monkeypatch.setattr(growth, "SETTLE_S", 1.0)
    monkeypatch.setattr(growth, "SLICE_S", 1.0)
    monkeypatch.setattr(growth, "LARGE", 8)
    growth.growth((4, 8, 12))
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert len(rows) == 2 + 8
    assert (tmp_path / "growth.svg").read_text().startswith("<svg")
