"""Train by PPO where drones without a gateway fly: a repair strategy, train_placement:Trained.

pip install 'drone_mesh[lab,rl]' stable-baselines3 supersuit
PYTHONPATH=src python3 examples/train_placement.py --steps 100000
PYTHONPATH=src python3 -m drone_mesh.lab run examples/placement.yaml
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from drone_mesh.lab import PlacementPolicy

HERE = Path(__file__).resolve().parent
WEIGHTS = HERE / "placement.npz"
SEED = 7  # not that of placement.yaml: its layouts are for the comparison


class Trained(PlacementPolicy):
    """The mean action of the trained network. Needs numpy only."""

    def __init__(self) -> None:
        with np.load(WEIGHTS) as saved:
            self._layers = [(saved[f"w{n}"], saved[f"b{n}"]) for n in range(len(saved) // 2)]

    def decide(self, observation: np.ndarray) -> np.ndarray:
        """Forward through layers of tanh; the last one is linear."""
        *hidden, (weight, bias) = self._layers
        for inner_weight, inner_bias in hidden:
            observation = np.tanh(inner_weight @ observation + inner_bias)
        return weight @ observation + bias


def save(layers: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Write weights and biases of the layers, for Trained."""
    arrays = {f"w{n}": weight for n, (weight, _) in enumerate(layers)}
    np.savez(WEIGHTS, **arrays, **{f"b{n}": bias for n, (_, bias) in enumerate(layers)})


def train(steps: int, updates_of: int) -> None:
    """PPO with one network for all agents: each agent counts as an environment of its own."""
    import supersuit
    from stable_baselines3 import PPO
    from stable_baselines3.common.utils import set_random_seed

    from drone_mesh.lab.env import MeshEnv

    env = MeshEnv(HERE / "placement.yaml", PlacementPolicy, seed=SEED)
    env = supersuit.black_death_v3(env)  # an agent that has ended observes zeros
    env = supersuit.pettingzoo_env_to_vec_env_v1(env)
    env = supersuit.concat_vec_envs_v1(env, 1, base_class="stable_baselines3")
    set_random_seed(SEED)  # the vector environment of supersuit takes none
    model = PPO(
        "MlpPolicy", env, n_steps=updates_of, batch_size=256, gamma=0.95, ent_coef=0.001,
        learning_rate=1e-3, device="cpu", verbose=1,
    )  # fmt: skip
    while model.num_timesteps < steps:  # the weights after each update, should it be interrupted
        model.learn(updates_of * env.num_envs, reset_num_timesteps=False)
        net = model.policy.mlp_extractor.policy_net
        linear = [*(layer for layer in net if hasattr(layer, "weight")), model.policy.action_net]
        save([(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in linear])


def main() -> None:
    """Train and write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000, help="of all agents together")
    parser.add_argument("--updates-of", type=int, default=64, help="steps of the environment each")
    options = parser.parse_args()
    train(options.steps, options.updates_of)
    print(f"wrote {WEIGHTS}")


if __name__ == "__main__":
    main()
