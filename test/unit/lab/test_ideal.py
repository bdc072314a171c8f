"""Runs without packets: what each rule does in a step, and whole repairs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.ideal import run_ideal
from drone_mesh.lab.ideal_rules import IDEAL_RULES, Swarm
from drone_mesh.lab.scenario import Scenario, Streams


def swarm(places: list[tuple[float, float]], **changes: Any) -> Swarm:
    array = np.array(places, float)
    near = np.linalg.norm(array[:, None] - array[None], axis=2) < 9.0
    np.fill_diagonal(near, False)
    known: dict[str, Any] = {
        "places": array, "before": array.copy(), "parts": np.zeros(len(array), int), "home": 0,
        "near_lost": np.full_like(array, math.nan), "near": near,
        "middle": np.array([0.0, 0.0]), "step_m": 0.5, "range_m": 9.0,
    }  # fmt: skip
    return Swarm(**{**known, **changes})


def test_centering_flies_to_the_mean_of_all() -> None:
    moves = IDEAL_RULES["centering"](swarm([(0, 0), (20, 0)]))
    assert moves.tolist() == [[0.5, 0.0], [-0.5, 0.0]]


def test_home_moves_only_drones_without_a_path_to_the_gateway() -> None:
    moves = IDEAL_RULES["home"](swarm([(0, 0), (5, 0), (0, 20)], parts=np.array([0, 0, 1])))
    assert moves.tolist() == [[0, 0], [0, 0], [0, -0.5]]


def test_the_oracle_moves_a_part_as_a_block_over_the_shortest_gap() -> None:
    places = [(0, 0), (8, 0), (18, 0), (26, 0)]
    moves = IDEAL_RULES["oracle"](swarm(places, parts=np.array([0, 0, 1, 1])))
    assert moves.tolist() == [[0, 0], [0, 0], [-0.5, 0], [-0.5, 0]]


def test_hero_flies_to_lost_neighbours_and_the_others_follow() -> None:
    lost = np.array([[5.0, 0.0], [math.nan, math.nan]])
    before = np.array([[0.0, 0.0], [0.0, 5.0]])
    seen = swarm([(0.5, 0), (0, 5)], near_lost=lost, before=before)
    assert IDEAL_RULES["hero"](seen).tolist() == [[0.5, 0.0], [0.5, 0.0]]


def test_sidr_as_coded_flies_along_a_diagonal_and_as_described_to_the_middle() -> None:
    places = [(4, 0), (4, 2)]
    described = IDEAL_RULES["sidr"](swarm(places, middle=np.array([4.0, 9.0])))
    assert described.tolist() == [[0, 0.5], [0, 0.5]]
    coded = IDEAL_RULES["sidr_as_coded"](swarm(places, middle=np.array([6.0, 6.0])))
    assert coded[0, 0] == coded[0, 1] == pytest.approx(0.5 / math.sqrt(2))


def test_springs_and_the_fiedler_gradient_move_those_that_are_cut_off_or_as_published_all() -> None:
    split = swarm([(0, 0), (4, 0), (20, 0), (23, 0)], parts=np.array([0, 0, 1, 1]))
    for rule in ("virtual_spring", "fiedler"):
        moves = IDEAL_RULES[rule](split)
        assert (moves[:2] == 0).all()
        assert (moves[2:, 0] < 0).all()
        assert np.linalg.norm(moves, axis=1).max() == pytest.approx(0.5)
    assert IDEAL_RULES["virtual_spring_of_all"](split)[1, 0] < 0  # to the gateway, as all are
    assert IDEAL_RULES["fiedler_of_all"](split)[1, 0] > 0  # to the others
    for rule in ("virtual_spring_of_all", "fiedler_of_all"):
        assert (IDEAL_RULES[rule](split)[0] == 0).all()


@pytest.mark.parametrize("rule", ["centering", "home", "oracle", "virtual_spring", "fiedler"])
def test_rules_that_know_everything_heal_what_was_split(rule: str) -> None:
    content = {
        "model": "ideal", "layout": {"drones": 60, "width_m": 41}, "repair": rule,
        "speed_m_s": 0.75, "duration_s": 50, "faults": [{"at_s": 0, "kill": {"number": 30}}],
    }  # fmt: skip
    measured, digest = run_ideal(Scenario.model_validate(content), Streams(1, 0))
    assert measured["split"] == 1
    assert measured["healed"] == 1
    assert 0 < measured["t_total_s"] < 49.9
    assert measured["connected_share"] == 1.0
    assert (measured, digest) == run_ideal(Scenario.model_validate(content), Streams(1, 0))


def test_no_rule_flies_less_in_all_than_the_oracle() -> None:
    content = {
        "model": "ideal", "layout": {"drones": 60, "width_m": 41}, "speed_m_s": 0.75,
        "duration_s": 50, "faults": [{"at_s": 0, "kill": {"number": 25}}],
    }  # fmt: skip
    flown = {}
    for rule in ("oracle", "home", "centering"):
        total = 0.0
        for repetition in range(5):
            scenario = Scenario.model_validate({**content, "repair": rule})
            total += run_ideal(scenario, Streams(1, repetition))[0]["distance_total_m"]
        flown[rule] = total
    assert flown["oracle"] < flown["home"] < flown["centering"]


def test_a_rule_for_packets_is_none_without_them(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("name: x\nbase:\n  model: ideal\n  repair: thesis\n")
    with pytest.raises(ConfigurationError, match=r"line 4: repair: unknown rule 'thesis' for"):
        load_experiment(path)


KILL = "{at_s: 9, kill: {number: 1}}"


@pytest.mark.parametrize(
    ("base", "words"),
    [
        (f"faults: [{KILL}, {KILL}]", "line 5: faults: with model ideal one kill, of a random"),
        ("faults: [{at_s: 9, kill: {ids: [3]}}]", "line 5: faults: with model ideal one kill"),
        ("duration_s: 60", "faults: with model ideal one kill, of a random share or number or"),
        (
            f"faults: [{KILL}]\n  obstacles: {{boxes: [{{center: [9, 9, 2], size: [2, 2, 4]}}]}}",
            "line 6: obstacles: model ideal has none: its drones fly straight",
        ),
        (f"faults: [{KILL}]\n  sequence: {{}}", "line 6: sequence: model ideal has none"),
    ],
)
def test_what_no_run_without_packets_can_do_is_refused_when_the_file_is_read(
    tmp_path: Path, base: str, words: str
) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(f"name: x\nbase:\n  model: ideal\n  repair: home\n  {base}\n")
    with pytest.raises(ConfigurationError) as caught:
        load_experiment(path)
    assert words in str(caught.value)


def test_the_gateway_of_an_ideal_plan_may_have_any_id() -> None:
    content = {
        "model": "ideal", "layout": {"kind": "line", "drones": 5, "ids": "shuffled"},
        "repair": "nearest", "duration_s": 60,
        "faults": [{"at_s": 9, "kill": {"number": 1, "pick": "cut_vertex"}}],
    }  # fmt: skip
    for repetition in range(4):
        measured, _ = run_ideal(Scenario.model_validate(content), Streams(1, repetition))
        assert measured["distance_total_m"] == pytest.approx(6.0 * measured["cut_off"])
