"""User-defined parts of an experiment: techniques and metrics named `package.module:Name`."""

from __future__ import annotations

import contextlib
import difflib
import importlib
import inspect
import sys
from typing import Callable, Iterator, cast

from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.lab.metrics import METRICS
from drone_mesh.lab.record import RunRecord

OwnMetric = Callable[[RunRecord], float]


def add_search_path(folder: str) -> None:
    """Let `module:Name` find modules in this folder, an absolute path."""
    if folder not in sys.path:
        sys.path.insert(0, folder)


def check_technique(kind: str, name: str, model: str) -> None:
    """Raise ConfigurationError if there is no such routing or repair technique."""
    if kind == "repair" and model == "ideal":
        from drone_mesh.lab.ideal import IDEAL_RULES
        from drone_mesh.lab.ideal_plans import IDEAL_PLANS

        if name not in {**IDEAL_RULES, **IDEAL_PLANS}:
            known = ", ".join(sorted({**IDEAL_RULES, **IDEAL_PLANS}))
            raise ConfigurationError(f"unknown rule {name!r} for model ideal: use one of {known}")
        return
    with _one_line(f"{kind} {name!r} cannot be created"):
        network = Network(**{kind: name})  # type: ignore[arg-type]
        network.add_gateway(0, 0.0, 0.0)
        network.add_router(1, 1.0, 0.0)


def check_metric(name: str) -> None:
    """Raise ConfigurationError for a name that is neither a metric nor a user's function."""
    if ":" in name:
        own_metric(name)
    elif name not in METRICS:
        close = difflib.get_close_matches(name, METRICS, n=1)
        hint = f"did you mean {close[0]}?" if close else "`lab metrics` lists them"
        raise ConfigurationError(f"unknown metric {name}; {hint}")


def own_metric(name: str) -> OwnMetric:
    """The function named `package.module:function`. Raises ConfigurationError if there is none."""
    module_name, _, function_name = name.partition(":")
    with _one_line(f"metric {name} cannot be loaded"):
        function = getattr(importlib.import_module(module_name), function_name)
    if not callable(function):
        raise ConfigurationError(f"metric {name} is not a function")
    try:
        inspect.signature(function).bind(None)
    except TypeError as error:
        raise ConfigurationError(f"metric {name} must take one argument: the record") from error
    return cast(OwnMetric, function)


@contextlib.contextmanager
def _one_line(what: str) -> Iterator[None]:
    """A user's module may raise anything, even SyntaxError and SystemExit: report it as its error.

    Raises ConfigurationError, in one line.
    """
    try:
        yield
    except (ConfigurationError, KeyboardInterrupt):
        raise
    except BaseException as error:
        words = " ".join(str(error).split())
        if not isinstance(error, (ImportError, AttributeError)):
            words = f"{type(error).__name__}: {words}"
        raise ConfigurationError(f"{what}: {words}") from error


def own_column(name: str) -> str:
    """The column of runs.csv for a user's metric."""
    return name.partition(":")[2]
