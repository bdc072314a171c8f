"""The compiled core: the same results as Python, used only for the sources that it was made of."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drone_mesh import compiled

ROOT = Path(__file__).resolve().parents[3]
DIGEST = """
import hashlib, itertools
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.compiled import core
from drone_mesh.inprocess import Network
from drone_mesh.mobility import Area, Mobility, tracks_of

print(core())
for radio, routing, key in itertools.product(
    ("disc", "shared"), ("beacon", "child_table_tree"), (None, MeshKey(bytes(16)))
):
    network = Network(seed=7, radio=radio, routing=routing, key=key)
    network.add_fleet(1, 24, 5, 6.0)
    network.run_for(10.0)
    places = {node: network.location(node).to_vector() for node in network.nodes}
    mobility = Mobility("random_waypoint", speed_m_s=(1.0, 3.0))
    network.fly(tracks_of(mobility, places, {0}, Area(0.0, 0.0, 40.0, 40.0), seed=7))
    network.run_for(10.0)
    network.power(7, False)
    network.send(5, 20, b"hello")
    network.run_for(25.0)
    paths = [network.path_to_gateway(node) for node in network.nodes]
    seen = (network.events, network.air.delivered, paths, network.status())
    print(radio, routing, bool(key), hashlib.sha256(repr(seen).encode()).hexdigest())
"""

METRICS = """
from drone_mesh.lab.metrics import measure_all
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.simulation import Simulation

for kind in ("disc", "shared"):
    scenario = {"layout": {"drones": 6}, "radio": {"kind": kind}, "duration_s": 30.0}
    scenario["probes"] = {"per_s": 1.0, "from_s": 10.0}
    run = Simulation(Scenario.model_validate(scenario), Streams(0, 0)).run()
    print(sorted(measure_all(run).items()))
"""


def start(core: str, package: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, compiled.WISH: core, "PYTHONPATH": str(package)}
    return subprocess.run(
        [sys.executable, *command], env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.skipif(not compiled.build().is_dir(), reason="scripts/compile has not built it")
def test_seeded_meshes_do_the_same_in_both_cores() -> None:
    cores = ("python", "compiled")
    python, built = (start(core, ROOT / "src", "-c", DIGEST).stdout.splitlines() for core in cores)
    assert python[0].startswith("Python")
    assert built == ["compiled", *python[1:]]
    assert len(built) == 9


@pytest.mark.slow
@pytest.mark.skipif(not compiled.build().is_dir(), reason="scripts/compile has not built it")
def test_experiments_measure_the_same_in_both_cores() -> None:
    cores = ("python", "compiled")
    python, built = (start(core, ROOT / "src", "-c", METRICS) for core in cores)
    assert built.stdout.splitlines() == python.stdout.splitlines(), built.stderr
    assert python.stdout.count("'frame_rate'") == 2, python.stderr


@pytest.mark.slow
def test_a_build_is_found_until_a_source_of_its_rooms_changes(tmp_path: Path) -> None:
    source = tmp_path / "src/drone_mesh"
    shutil.copytree(ROOT / "src/drone_mesh", source, ignore=shutil.ignore_patterns("__pycache__"))
    where = start(
        "python", source.parent, "-c", "import drone_mesh.compiled as c; print(c.build())"
    )
    Path(where.stdout.strip()).mkdir(parents=True)
    assert start("compiled", source.parent, "-c", "import drone_mesh").returncode == 0
    with (source / "drone/location.py").open("a") as edited:
        edited.write("# edited\n")
    refused = start("compiled", source.parent, "-c", "import drone_mesh")
    assert "no build of these sources" in refused.stderr
    assert start("", source.parent, "-c", "import drone_mesh").returncode == 0


def test_a_wish_for_another_core_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(compiled.WISH, "pyhton")
    with pytest.raises(ImportError, match="DRONE_MESH_CORE=pyhton: expected python or compiled"):
        compiled.use_build()
