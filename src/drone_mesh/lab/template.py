"""A commented template of an experiment."""

from __future__ import annotations

import re
from pathlib import Path

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import NAME_PATTERN

TEMPLATE = """\
# {name}: write here what this experiment compares, and why.
#   lab plan {file}      shows cells, runs and time; writes nothing
#   lab run {file}       executes the runs missing from results/{name}
#   lab report results/{name}
name: {name}
seed: 1        # of all random choices
seeds: 20      # repetitions: the r-th has the same layout, victims and losses in every cell

base:          # one run; keys that are left out have their defaults
  layout:
    kind: uniform        # uniform, clusters, grid, line, casus or file
    drones: 50           # gateways included
    mean_degree: 8       # neighbours in range of a drone, on average
    gateways: 1
    gateway_at: middle   # middle, corner or random
  range_m: 9.0
  radio: {{loss: 0.0}}
  routing: child_table_tree      # or your_module:YourTechnique, in a file beside this one
  repair: thesis                 # or your_module:YourStrategy
  timing: {{check_period_s: 10, connection_lost_after_s: 30}}
  faults:
    - at_s: 30
      kill: {{share: 0.3}}         # or number: 5, ids: [3, 7]; pick: cut_vertex, busiest, circle...
    # - at_s: 60
    #   jam: {{center: [10, 10], radius_m: 12, for_s: 20}}
    # - when: 10 s after the first flight
    #   revive: {{number: 3}}
  duration_s: 240

sweep:         # every combination of these values is a cell
  faults.kill.share: [0.1, 0.3]
  timing.connection_lost_after_s: [10, 30]

metrics: [healed, t_total_s, uptime, distance_total_m, packets]   # `lab metrics` lists all metrics
compare: {{over: timing.connection_lost_after_s, baseline: 30}}
"""


def write_template(name: str) -> Path:
    """Write NAME.yaml into the current folder. Raises ConfigurationError if it cannot."""
    if not re.match(NAME_PATTERN, name):
        raise ConfigurationError(f"{name!r}: use letters, digits, dot, dash and underscore")
    path = Path(f"{name}.yaml")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(TEMPLATE.format(name=name, file=path))
    except FileExistsError:
        raise ConfigurationError(f"{path} already exists; it was not changed") from None
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    return path
