"""The examples do what the documents say they do."""

import importlib
import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from patience import wait_for

from drone_mesh.drone.engines import FlightOptions, create_engine
from drone_mesh.drone.location import Location
from drone_mesh.errors import LocationUnknown
from drone_mesh.lab.command import main as lab

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
EXPERIMENT = """\
name: half_way
seeds: 8
base:
  layout: {kind: line, drones: 5}
  faults: [{at_s: 20, kill: {number: 1, pick: cut_vertex}}]
  duration_s: 90
sweep: {repair: [thesis, stay]}
"""


@pytest.fixture
def run_example(tmp_path):
    def run(name, *arguments):
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        environment.pop("DRONE_MESH_CORE", None)  # compiled if it has been built, as for users
        done = subprocess.run(
            [sys.executable, str(ROOT / "examples" / name), *arguments],
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_a_mesh_in_process_heals(run_example):
    printed = run_example("inprocess_network.py")
    assert "all nodes with a path are connected: True" in printed


def test_two_routing_techniques_are_compared_and_one_run_is_drawn(run_example, tmp_path):
    printed = run_example("own_routing.py", "--runs", "1", "--gridsize", "4", "--page", "run.html")
    rows = [line.split() for line in printed.splitlines()[1:3]]
    assert [row[0] for row in rows] == ["child_table_tree", "__main__:SteadyTree"]
    assert all(row[1] == "100.0%" for row in rows)
    assert "</html>" in (tmp_path / "run.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--runs", "0"], "--runs must be 1 or more"),
        (["--page", "run.html"], "--page needs matplotlib"),
    ],
)
def test_a_comparison_that_cannot_end_well_is_refused_at_once(monkeypatch, capsys, arguments, why):
    monkeypatch.setitem(sys.modules, "matplotlib", None)  # as if it were not installed
    for name in [name for name in sys.modules if name.startswith("drone_mesh.lab.run_report")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    monkeypatch.setattr(sys, "argv", ["own_routing.py", *arguments])
    example = importlib.import_module("own_routing")
    monkeypatch.setattr(example, "run", lambda *_: pytest.fail("it computes"))
    with pytest.raises(SystemExit) as refused:
        example.main()
    assert refused.value.code == 2
    assert why in capsys.readouterr().err


def test_a_users_own_engine_is_chosen_by_name_and_flies(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        monkeypatch.setenv("DRONE_PORT", str(listener.getsockname()[1]))
        monkeypatch.syspath_prepend(str(ROOT / "examples"))
        engine = create_engine(3, Location(0, 0, 0), FlightOptions(drone="own_engine:OwnEngine"))
        drone, _ = listener.accept()
        with drone, drone.makefile("rw") as line:
            with pytest.raises(LocationUnknown):
                engine.get_location()
            engine.set_goal(2.5, 1.5, 4)
            assert line.readline() == "goto 1.5 2.5 4\n"
            line.write("at 1.5 2.5 4.0\n")
            line.flush()
            wait_for("the place", lambda: engine._location is not None)
            assert engine.get_location() == Location(latitude=2.5, longitude=1.5, height=4.0)


def test_a_users_own_repair_runs_beside_the_default(run_example):
    lines = run_example("own_repair.py", "--runs", "1").splitlines()
    assert [line.partition(": ")[0] for line in lines] == ["thesis", "__main__:LowestId"]


def test_the_notebook_reads_and_plots_the_results_of_an_experiment(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    (tmp_path / "half_way.yaml").write_text(EXPERIMENT)
    out = str(tmp_path / "results" / "half_way")
    assert lab(["run", str(tmp_path / "half_way.yaml"), "--out", out, "--workers", "0"]) == 0
    page = nbformat.read(ROOT / "examples" / "read_results.ipynb", as_version=4)
    nbclient.NotebookClient(page, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in page.cells for output in cell.get("outputs", ())]
    assert [o.name for o in outputs if o.output_type == "stream"] == ["stdout"]  # no warnings
    flown = next(o.text for o in outputs if o.output_type == "stream")
    mean, low, high = map(float, re.search(r"distance_total_m +(.+)", flown)[1].split())
    assert low <= mean <= high < 0.0  # who stays flies less
    assert any("image/png" in output.get("data", {}) for output in outputs)
