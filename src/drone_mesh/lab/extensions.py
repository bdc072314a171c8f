"""User-defined parts of an experiment: techniques and metrics named `package.module:Name`.

To load an experiment checks their names; only a run, or `check_own` before it, loads their code.
"""

from __future__ import annotations

import difflib
import inspect
import re
import sys
from typing import Callable, Iterable, cast

from drone_mesh.by_name import in_one_line, load_by_name
from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.lab.metrics import METRICS
from drone_mesh.lab.record import RunRecord
from drone_mesh.lab.terminal import PROGRAM

_OWN = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")

OwnMetric = Callable[[RunRecord], float]


def add_search_path(folder: str) -> None:
    """Let `module:Name` find modules in this folder, an absolute path; installed ones come first.

    A file in it must not stand in for a module that some library loads later.
    """
    if folder not in sys.path:
        sys.path.append(folder)


def is_own(name: str) -> bool:
    """Whether it names a part in a module of the user. Raises ConfigurationError for neither."""
    if ":" in name and _OWN.fullmatch(name) is None:
        raise ConfigurationError(f"{name!r:.60}: expected a name, or package.module:Name")
    return ":" in name


def check_own(techniques: Iterable[tuple[str, str]], metrics: Iterable[str]) -> None:
    """Load the user's modules: techniques by kind, and metrics. Raises ConfigurationError."""
    for kind, name in techniques:
        _create(kind, name)
    for name in metrics:
        own_metric(name)


def check_technique(kind: str, name: str, model: str) -> None:
    """Raise ConfigurationError if there is no such routing or repair technique.

    Whether the module of a user has one shows when it is loaded.
    """
    if kind == "repair" and model == "ideal":
        from drone_mesh.lab.ideal_plans import IDEAL_PLANS
        from drone_mesh.lab.ideal_rules import IDEAL_RULES

        if name not in {**IDEAL_RULES, **IDEAL_PLANS}:
            known = ", ".join(sorted({**IDEAL_RULES, **IDEAL_PLANS}))
            raise ConfigurationError(f"unknown rule {name!r} for model ideal: use one of {known}")
        return
    if not is_own(name):
        _create(kind, name)


def _create(kind: str, name: str) -> None:
    with in_one_line(f"{kind} {name!r} cannot be created"):
        network = Network(**{kind: name})  # type: ignore[arg-type]
        network.add_gateway(0, 0.0, 0.0)
        network.add_router(1, 1.0, 0.0)


def check_metric(name: str) -> None:
    """Raise ConfigurationError for a name that is neither a metric nor may be a user's function."""
    if not is_own(name) and name not in METRICS:
        close = difflib.get_close_matches(name, METRICS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"`{PROGRAM} metrics` lists them"
        raise ConfigurationError(f"unknown metric {name}; {hint}")


def own_metric(name: str) -> OwnMetric:
    """The function named `package.module:function`. Raises ConfigurationError if there is none."""
    function = load_by_name("metric", name)
    if not callable(function):
        raise ConfigurationError(f"metric {name} is not a function")
    try:
        inspect.signature(function).bind(None)
    except TypeError as error:
        raise ConfigurationError(f"metric {name} must take one argument: the record") from error
    return cast(OwnMetric, function)


def column_of(name: str) -> str:
    """The column of runs.csv for a metric, of this package or a user's."""
    return name.rpartition(":")[2]
