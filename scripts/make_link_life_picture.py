"""Makes docs/pictures/link_life.png from the results of experiments/link_life.yaml."""

from __future__ import annotations

import argparse
import csv
import statistics
import sys
from collections import defaultdict
from pathlib import Path

from matplotlib.figure import Figure

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "link_life.png"
TICKS_S = (10, 20, 50, 100, 200, 500)
WAYS = (("pdr_up", "to the gateway"), ("pdr_down", "from the gateway"))


def main() -> None:
    """Arguments: the folders of the results."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("results", type=Path, nargs="+", help="a folder that `lab run` made")
    try:
        rows = [row for folder in parser.parse_args().results for row in runs_in(folder)]
    except OSError as error:
        sys.exit(f"make_link_life_picture: {error.filename}: {error.strerror}")
    except ValueError as error:
        sys.exit(f"make_link_life_picture: {error}")
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    for axes, (metric, title) in zip(figure.subplots(1, 2, sharey=True), WAYS):
        for routing in dict.fromkeys(row["routing"] for row in rows):
            runs = defaultdict(list)
            for row in rows:
                if row["routing"] == routing:
                    runs[row["mobility.speed_m_s"]].append(row)
            points = sorted(
                (mean(group, "link_life_s"), 100 * mean(group, metric)) for group in runs.values()
            )
            axes.plot(*zip(*points), marker="o", label=routing)
        axes.set(xscale="log", title=title, xlabel="life of a link, s", ylim=(0, 102))
        axes.set_xticks(TICKS_S, [str(tick) for tick in TICKS_S])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("messages that arrive, %")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside right center")
    figure.savefig(PICTURE, dpi=110)


def runs_in(folder: Path) -> list[dict[str, str]]:
    """The rows of its runs.csv. Raises OSError, and ValueError if they do not fit the picture."""
    with (folder / "runs.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    missing = {"routing", "mobility.speed_m_s", "link_life_s", *dict(WAYS)}.difference(*rows[:1])
    if missing:
        raise ValueError(f"{folder}: no runs of experiments/link_life.yaml: no {min(missing)}")
    return rows


def mean(rows: list[dict[str, str]], metric: str) -> float:
    """Over these runs."""
    return statistics.fmean(float(row[metric]) for row in rows)


if __name__ == "__main__":
    main()
