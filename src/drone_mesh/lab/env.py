"""A PettingZoo environment: the routers of a simulated mesh are the agents (docs/rl.md)."""

from __future__ import annotations

import functools
import math
import secrets
from operator import methodcaller
from pathlib import Path
from typing import Any, Callable, Mapping, Sequence

import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from pettingzoo import ParallelEnv

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import extensions
from drone_mesh.lab.experiment import LoadedExperiment, load_experiment
from drone_mesh.lab.metrics import METRICS, measure_all
from drone_mesh.lab.policies import FAR, PlacementPolicy, Policy, RoutingPolicy
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.simulation import Simulation
from drone_mesh.lab.worker import quiet_nodes

__all__ = ["MeshEnv"]

MOST_DRAWS = 100  # in a row in which no router may act
DEFAULT_REWARD = {"connected_share": 1.0, "distance_total_m": -0.001}


class MeshEnv(ParallelEnv[str, np.ndarray, Any], EzPickle):
    """A run of an experiment in which an agent decides for each router, by a policy's rules.

    A step lasts until some agent may act again; an action of one that may not has no effect
    (`may_act` in its info). A router that is switched off after a step has terminated, and does not
    come back as an agent. All are truncated at the end of the run. A copy begins anew.
    """

    metadata = {"name": "drone_mesh", "render_modes": []}
    render_mode = None

    def __init__(
        self,
        experiment: str | Path,
        policy: type[PlacementPolicy] | type[RoutingPolicy] = PlacementPolicy,
        reward: Mapping[str, float] = DEFAULT_REWARD,
        overrides: Sequence[str] = (),
        seed: int | None = None,
    ) -> None:
        """`experiment`: a file of the lab, whose cells may differ in their technique only.

        `policy`: what agents observe and do. `reward`: weights of metrics, `module:function`
        included; each agent gets the growth of the weighted sum, so that its return is that of the
        run. `seed`: until `reset` gives one, as not every wrapper does. Raises ConfigurationError.
        """
        EzPickle.__init__(self, experiment, policy, reward, overrides, seed)
        self._policy = policy
        self._kind = "repair" if issubclass(policy, PlacementPolicy) else "routing"
        self._scenario = _scenario(load_experiment(Path(experiment), overrides), self._kind)
        self._reward = [(_measure(name), weight) for name, weight in reward.items()]
        self._seed, self._draw = seed, 0
        self._simulation: Simulation | None = None
        nodes = self._begin(Streams(0, 0)).network.nodes
        self._nodes = {f"router_{n}": n for n in sorted(nodes) if not nodes[n].is_gateway}
        self.close()
        self.possible_agents = list(self._nodes)
        self.agents: list[str] = []
        box = functools.partial(spaces.Box, dtype=np.float32)
        self.observation_spaces = {
            agent: box(-FAR, FAR, (policy.OBSERVED,)) for agent in self._nodes
        }
        self.action_spaces = {
            agent: spaces.Discrete(policy.ACTIONS) if policy.ACTIONS else box(-1.0, 1.0, (2,))
            for agent in self._nodes
        }

    def observation_space(self, agent: str) -> spaces.Space[np.ndarray]:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Begin the next run, at the time when an agent may act.

        The runs after `seed` are the repetitions of an experiment with this seed, but for those in
        which no agent may ever act. Without any seed they are new in each environment. Raises
        ConfigurationError if there are too many in which none may act.
        """
        if seed is not None or self._seed is None:
            self._seed, self._draw = secrets.randbits(32) if seed is None else seed, 0
        for _ in range(MOST_DRAWS):
            self._begin(Streams(self._seed, self._draw))
            self._draw += 1
            if self._pass_time():
                break
        else:
            raise ConfigurationError(
                f"in {MOST_DRAWS} runs no router may act: does a fault cut routers off?"
            )
        self.agents = list(self.possible_agents)
        self._value = self._measured()
        return self._observations(), self._infos()

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[
        dict[str, np.ndarray],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        for agent, action in actions.items():
            self._at(agent, methodcaller("act", action))
        goes_on = self._pass_time()
        before, self._value = self._value, self._measured()
        agents, gained = self.agents, self._value - before
        observations, infos = self._observations(), self._infos()
        off = {agent: not self._is_on(agent) for agent in agents}
        self.agents = [agent for agent in agents if goes_on and not off[agent]]
        truncated = {agent: not (goes_on or off[agent]) for agent in agents}
        return observations, dict.fromkeys(agents, gained), off, truncated, infos

    def metrics(self) -> dict[str, float]:
        """All metrics of the run so far, as in runs.csv; NaN: undefined."""
        assert self._simulation is not None
        return measure_all(self._simulation.record_so_far())

    def close(self) -> None:
        if self._simulation is not None:
            self._simulation.network.stop()
            self._simulation = None

    def _begin(self, streams: Streams) -> Simulation:
        self.close()
        self._created: list[Policy] = []
        self._policies: dict[int, Policy] = {}  # by node
        scenario = self._scenario.model_copy(update={self._kind: self._create})
        self._simulation = Simulation(scenario, streams)
        self._samples = self._simulation.samples()
        return self._simulation

    def _create(self) -> Policy:
        policy = self._policy()
        policy.commanded = True
        self._created.append(policy)
        return policy

    def _pass_time(self) -> bool:
        """Let at least STEP_S pass, until an agent may act; False: the run is over."""
        assert self._simulation is not None
        until_s = self._simulation.network.now_s() + self._policy.STEP_S
        with quiet_nodes():
            for now_s in self._samples:
                if not self._policies:  # their nodes have started now
                    self._policies = {policy.node_id: policy for policy in self._created}
                if now_s > until_s - 1e-6 and any(map(self._may_act, self._nodes)):
                    return True
        return False

    def _at(self, agent: str, do: Callable[[Policy], Any]) -> Any:
        """Do something in the mesh software of a node, at the present time."""
        assert self._simulation is not None
        node = self._simulation.network.nodes[self._nodes[agent]]
        found: list[Any] = []

        def work(now_s: float) -> None:
            node.component.tick(now_s)
            found.append(do(self._policies[node.node_id]))

        node.submit(work)
        return found[0]

    def _is_on(self, agent: str) -> bool:
        assert self._simulation is not None
        return self._simulation.network.nodes[self._nodes[agent]].antenna.powered

    def _may_act(self, agent: str) -> bool:
        return self._is_on(agent) and self._policies[self._nodes[agent]].may_act

    def _observations(self) -> dict[str, np.ndarray]:
        return {agent: self._at(agent, methodcaller("observe")) for agent in self.agents}

    def _infos(self) -> dict[str, dict[str, Any]]:
        return {agent: {"may_act": self._may_act(agent)} for agent in self.agents}

    def _measured(self) -> float:
        assert self._simulation is not None
        record = self._simulation.record_so_far()
        values = ((measure(record), weight) for measure, weight in self._reward)
        return math.fsum(weight * value for value, weight in values if not math.isnan(value))


def _scenario(loaded: LoadedExperiment, kind: str) -> Scenario:
    """The one scenario of the cells, but for their technique."""
    cells = [cell.scenario for cell in loaded.cells]
    one = cells[0].model_copy(update={kind: ""})
    if any(cell.model_copy(update={kind: ""}) != one for cell in cells):
        raise ConfigurationError(f"{loaded.path}: its cells differ in more than {kind}: choose one")
    if one.model == "ideal" or one.sequence is not None or one.layout.ids == "shuffled":
        what = "model ideal, a sequence and shuffled ids"
        raise ConfigurationError(f"{loaded.path}: {what} have no routers that are always the same")
    extensions.add_search_path(str(loaded.folder.resolve()))
    return cells[0]


def _measure(name: str) -> Callable[[Any], float]:
    extensions.check_metric(name)
    return METRICS[name].measure if name in METRICS else extensions.own_metric(name)
