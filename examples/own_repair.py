"""A repair strategy of your own: of a group, the drone with the lowest id flies.

PYTHONPATH=src python3 examples/own_repair.py --runs 20
"""

from __future__ import annotations

import argparse

from drone_mesh import Step, Thesis
from drone_mesh.lab import measure_all, run_sequence


class LowestId(Thesis):
    """Like Thesis, with another score."""

    def _score(self, step: Step) -> float:
        """Higher for lower ids; a second choice scores less than any first choice."""
        return 1000.0 - self.mesh.node_id if not step.home else 1.0


def main() -> None:
    """Compare both strategies over the same random faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="sequences (default: %(default)s)")
    runs = parser.parse_args().runs
    for repair in ("thesis", f"{__name__}:LowestId"):
        outcomes = [measure_all(run_sequence(number, repair)) for number in range(runs)]
        back = sum(outcome["times_back"] for outcome in outcomes)
        flown_m = sum(outcome["distance_total_m"] for outcome in outcomes)
        print(f"{repair}: {back:.0f} nodes connected again within 120 s, {flown_m:.0f} m flown")


if __name__ == "__main__":
    main()
