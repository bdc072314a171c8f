"""The environment for multi-agent learning, and policies as techniques of the lab."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pettingzoo.test")

from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.lab import PlacementPolicy, RoutingPolicy
from drone_mesh.lab.command import main
from drone_mesh.lab.env import MeshEnv
from drone_mesh.lab.network_sample import route_hops
from drone_mesh.lab.results import load_results

ROOT = Path(__file__).resolve().parents[3]
GAP = """\
name: gap
base:
  layout: {kind: line, drones: 5}
  faults: [{at_s: 15, kill: {ids: [3]}}]
  timing: {connection_lost_after_s: 5}
  duration_s: 60
sweep: {repair: [stay, thesis]}
"""
PLACEMENT = {"policy": PlacementPolicy}
ROUTING = {"policy": RoutingPolicy, "reward": {"connected_share": 1.0, "packets": -1e-4}}


@pytest.fixture
def gap(tmp_path: Path) -> Path:
    path = tmp_path / "gap.yaml"
    path.write_text(GAP)
    return path


def made(gap: Path, settings: dict[str, Any]) -> MeshEnv:
    routing = settings["policy"] is RoutingPolicy
    return MeshEnv(gap, **settings, overrides=["sweep.repair=[stay]"] if routing else ())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("settings", [PLACEMENT, ROUTING], ids=["placement", "routing"])
def test_it_passes_the_tests_of_its_interface(gap: Path, settings: dict[str, Any]) -> None:
    parallel_api_test(made(gap, settings), num_cycles=20)
    parallel_seed_test(lambda: made(gap, settings), num_cycles=10)
    seed_test(lambda: parallel_to_aec(made(gap, settings)), num_cycles=10)


@pytest.mark.filterwarnings("ignore:.*(docstring|render|spaces|Observation|rewards).*")
def test_it_passes_the_test_of_turns(gap: Path) -> None:
    api_test(parallel_to_aec(made(gap, PLACEMENT)), num_cycles=50)


def test_who_flies_to_the_gap_closes_it_and_all_are_rewarded_for_it(gap: Path) -> None:
    env = MeshEnv(gap)
    _, infos = env.reset(seed=1)
    assert env.agents == env.possible_agents == ["router_1", "router_2", "router_3", "router_4"]
    assert [infos[agent]["may_act"] for agent in env.agents] == [False, False, False, True]
    before, returns = env.metrics(), dict.fromkeys(env.agents, 0.0)
    west = {agent: np.array([-1.0, 0.0]) for agent in env.agents}
    while env.agents:
        observed, rewards, ended, cut, infos = env.step(west)
        returns = {agent: returns[agent] + reward for agent, reward in rewards.items()}
    after = env.metrics()
    assert after["healed"] == 1
    assert after["moved"] == 1  # the others may not act
    assert [agent for agent in cut if not cut[agent]] == ["router_3"]  # it was dead,
    assert [agent for agent in ended if ended[agent]] == ["router_3"]  # and has ended
    gained = after["connected_share"] - before["connected_share"]
    flown_m = after["distance_total_m"] - before["distance_total_m"]
    assert flown_m > 3.0
    for reward in returns.values():
        assert math.isclose(reward, gained - 0.001 * flown_m)
    connected = {agent: seen[1] for agent, seen in observed.items()}
    assert connected == {"router_1": 1, "router_2": 1, "router_3": 0, "router_4": 1}


@pytest.mark.timeout(20)
def test_an_action_that_is_no_number_lets_a_drone_stay(gap: Path) -> None:
    env = MeshEnv(gap)
    env.reset(seed=1)
    while env.agents:  # as of a network whose training has diverged
        env.step({agent: np.array([math.nan, 0.0]) for agent in env.agents})
    assert env.metrics()["repair_flights"] == 0


def test_a_router_that_dies_has_ended(gap: Path) -> None:
    gap.write_text(
        GAP.replace("kill: {ids: [3]}}", "kill: {ids: [3]}}, {at_s: 55, kill: {ids: [4]}}")
    )
    env = MeshEnv(gap)
    env.reset(seed=1)
    ended: dict[str, bool] = {}
    while env.agents and not ended.get("router_4"):
        _, _, ended, _, _ = env.step({agent: np.zeros(2) for agent in env.agents})
    assert ended == {"router_1": False, "router_2": False, "router_4": True}  # as 3 before


def test_a_bad_next_hop_cuts_off_and_the_own_choice_of_the_tree_does_not(gap: Path) -> None:
    gap.write_text(GAP.replace("[3]", "[4]"))
    shares = []
    for action in (0, 2):  # 2: the neighbour farther from the gateway
        env = made(gap, ROUTING)
        env.reset(seed=1)
        for _ in range(4):
            env.step(dict.fromkeys(env.agents, action))
        shares.append(env.metrics()["connected_share"])
    assert shares[0] == 1.0 > shares[1]


@pytest.mark.parametrize(
    ("change", "reward", "message"),
    [
        (("{ids: [3]}", "{ids: [4]}"), {"healed": 1.0}, "in 100 runs no router may act"),
        (("line, ", "line, ids: shuffled, "), {"healed": 1.0}, "always the same"),
        (("sweep: {", "sweep: {duration_s: [60, 70], "), {"healed": 1.0}, "differ in more than"),
        (("", ""), {"heald": 1.0}, "did you mean healed?"),
    ],
)
def test_what_is_no_task_is_refused(
    gap: Path, monkeypatch: pytest.MonkeyPatch, change: Any, reward: Any, message: str
) -> None:
    gap.write_text(GAP.replace(*change) if change[0] else GAP)
    with pytest.raises(ConfigurationError, match=message.replace("?", r"\?")):
        MeshEnv(gap, reward=reward).reset(seed=1)


@pytest.mark.slow
def test_a_trained_policy_is_a_strategy_of_the_lab(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its network is made here: it flies west, to the gateway. Nothing that trains is needed."""
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import train_placement

    monkeypatch.setattr(train_placement, "WEIGHTS", tmp_path / "placement.npz")
    zeros = np.zeros((8, PlacementPolicy.OBSERVED))
    train_placement.save([(zeros, np.ones(8)), (-np.ones((2, 8)) * [[1], [0]], np.zeros(2))])
    (tmp_path / "gap.yaml").write_text(
        GAP.replace("[stay, thesis]", "[stay, 'train_placement:Trained']")
    )
    out = tmp_path / "results"
    how = ["--out", str(out), "--workers", "0", "seeds=2"]
    assert main(["run", str(tmp_path / "gap.yaml"), *how]) == 0
    results = load_results(out)
    healed = [[row["healed"] for row in results.of_cell(cell).values()] for cell in (0, 1)]
    assert healed == [["0", "0"], ["1", "1"]]


@pytest.mark.slow
def test_a_library_trains_in_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only where stable-baselines3 and supersuit are installed: they bring 800 MB."""
    pytest.importorskip("stable_baselines3")
    pytest.importorskip("supersuit")
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import train_placement

    monkeypatch.setattr(train_placement, "WEIGHTS", tmp_path / "placement.npz")
    train_placement.train(steps=300, updates_of=4)
    action = train_placement.Trained().decide(np.zeros(PlacementPolicy.OBSERVED, np.float32))
    assert action.shape == (2,)
    assert np.isfinite(action).all()


def test_routes_that_became_a_loop_have_no_hops() -> None:
    """Actions may have made one after the latest sample, which says who was served."""
    policies: list[RoutingPolicy] = []

    class Commanded(RoutingPolicy):
        commanded = True

        def __init__(self) -> None:
            super().__init__()
            policies.append(self)

    network = Network(1, routing=Commanded)
    network.add_gateway(0, 0.0, 0.0)
    for node in (1, 2):
        network.add_router(node, 6.0 * node, 0.0)
    assert network.run_until(network.all_connected, within_s=60.0)
    served = frozenset({1, 2})
    assert route_hops(network, served) == {1: 1, 2: 2}
    (first,) = (policy for policy in policies if policy.node_id == 1)
    first.observe()
    first.act(2)
    network.run_for(0.1)
    assert route_hops(network, served) == {}
