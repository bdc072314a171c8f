"""Merges the shards of an experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Sequence

from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.store import (
    EXPERIMENT,
    PROVENANCE,
    Store,
    StoreError,
    read_provenance,
)


def merge(into: Path, shards: Sequence[Path]) -> int:
    """Add all new rows of the shards; returns the number of runs added.

    Raises StoreError for shards of different experiments, or one run of different code.
    """
    sessions = [read_provenance(shard) for shard in shards]
    for shard, found in zip(shards, sessions):
        if not found:
            raise StoreError(f"{shard}: no {PROVENANCE} there, so it is not a results folder")
    digests = {found[-1]["experiment_hash"] for found in sessions}
    if len(digests) > 1:
        raise StoreError("these shards belong to different experiments: their files differ")
    overrides = list(sessions[0][-1].get("overrides", ()))
    folder = Path(sessions[0][-1]["folder"])
    plan = Plan(load_experiment(shards[0] / EXPERIMENT, overrides, folder))
    store = Store(into, plan)
    try:
        added = store.take_from(shards)
        store.describe([one for found in sessions for one in found])
        store.export()
    finally:
        store.close()
    return added
