"""The experiments that come with the package."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.experiment_keys import write_template
from drone_mesh.lab.metrics import METRICS, listed
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.worker import execute

EXPERIMENTS = Path(__file__).resolve().parents[3] / "experiments"
BOXES = "street"  # of obstacles.yaml, and no experiment itself
MOST = 18  # drones: a run of a hundred has the same parts
SUITES = sorted({path.stem for path in EXPERIMENTS.glob("*.yaml")} - {BOXES})


@pytest.mark.parametrize("name", SUITES)
def test_each_suite_is_a_valid_experiment_whose_runs_do_not_fail(name: str) -> None:
    loaded = load_experiment(EXPERIMENTS / f"{name}.yaml")
    assert loaded.experiment.name == name
    spec = next(iter(Plan(loaded))).spec
    scenario = json.loads(spec.scenario)  # a cell may set the duration
    if name != "published":
        begins_s = [fault.get("at_s", 65.0) for fault in scenario["faults"]]
        until_s = min(70.0, max([scenario["probes"]["from_s"], *begins_s]) + 5.0)
        scenario["duration_s"] = min(scenario["duration_s"], until_s)
        scenario["sample_s"] = 5
        layout = scenario["layout"]
        if "drones" in layout and layout.get("require") != "connected":
            layout["drones"] = min(MOST, layout["drones"])
        if scenario.get("sequence"):
            scenario["sequence"]["drones"] = [8, 12]
    assert execute(spec._replace(scenario=json.dumps(scenario))).message == ""


def test_the_template_of_lab_new_is_a_valid_experiment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_template("first_try")
    assert len(load_experiment(path).cells) == 4
    with pytest.raises(ConfigurationError, match=r"first_try\.yaml already exists; it was not"):
        write_template("first_try")
    with pytest.raises(ConfigurationError, match="use letters, digits"):
        write_template("../x")


def test_every_metric_is_defined_in_the_page_of_the_lab() -> None:
    page = (EXPERIMENTS.parent / "docs/lab.md").read_text(encoding="utf-8")
    assert len(METRICS) > len(listed()) + 20  # the types of packets share two rows
    for name, metric in listed().items():
        assert f"| `{name}` | {metric.unit} | {metric.definition} |" in page
