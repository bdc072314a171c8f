"""Merges the shards of an experiment."""

from __future__ import annotations

import json
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

    Raises StoreError for shards of different experiments.
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
    added = 0
    try:
        store.describe(sessions[0][-1])
        everything = [*read_provenance(into)[:-1], *(one for found in sessions for one in found)]
        (into / PROVENANCE).write_text(json.dumps(everything, indent=2) + "\n", encoding="utf-8")
        for shard in shards:
            added += store.take_from(shard)
    finally:
        store.put_in_order()
        store.close()
    return added
