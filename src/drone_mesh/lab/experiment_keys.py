"""The keys of an experiment file, and a template of one."""

# Pydantic reads these annotations when the module is loaded, and Python 3.8 has no list[int].
import re
from pathlib import Path
from typing import Any, Dict, List, Optional

from pydantic import BaseModel, ConfigDict, Field
from typing_extensions import Annotated, Literal

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.scenario_parts import Part
from drone_mesh.lab.terminal import PROGRAM

TEMPLATE = Path(__file__).resolve().parent / "experiment.template.yaml"
NAME_PATTERN = r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$"  # used as the name of a folder


class Stop(Part):
    """Add seeds until the confidence interval of a metric is narrow enough in every cell."""

    metric: str
    half_width: Optional[Annotated[float, Field(gt=0)]] = None
    relative_half_width: Optional[Annotated[float, Field(gt=0)]] = None
    max_seeds: Annotated[int, Field(ge=1, le=1_000_000)] = 400


class Compare(Part):
    """The paired comparison of the report: each value of an axis against its baseline."""

    over: str  # an axis of the sweep
    baseline: Any


class Experiment(BaseModel):
    """The whole file, before its cells are expanded."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    title: str = ""  # of the report
    seed: Annotated[int, Field(ge=0)] = 1  # of everything random in the experiment
    seeds: Annotated[int, Field(ge=1, le=1_000_000)] = 10  # repetitions of each cell
    base: Dict[str, Any] = {}  # a Scenario; checked once per cell
    sweep: Dict[str, List[Any]] = {}
    zip: List[Dict[str, List[Any]]] = []
    where: Optional[str] = None
    stop: Optional[Stop] = None
    metrics: List[str] = []
    compare: Optional[Compare] = None
    control: bool = False  # run the baseline of `compare` on other seeds, too
    expect: List[str] = []
    draws: Literal["all", "split", "whole"] = "all"  # which runs the report counts
    timeout_s: Annotated[float, Field(gt=0)] = 600.0  # wall time of one run


def write_template(name: str) -> Path:
    """Write NAME.yaml into the current folder. Raises ConfigurationError if it cannot."""
    if not re.match(NAME_PATTERN, name):
        raise ConfigurationError(f"{name!r}: use letters, digits, dot, dash and underscore")
    path = Path(f"{name}.yaml")
    try:
        with path.open("x", encoding="utf-8") as file:
            text = TEMPLATE.read_text(encoding="utf-8")
            file.write(text.format(name=name, file=path, program=PROGRAM))
    except FileExistsError:
        raise ConfigurationError(f"{path} already exists; it was not changed") from None
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    return path
