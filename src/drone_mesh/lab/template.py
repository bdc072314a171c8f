"""A commented template of an experiment."""

from __future__ import annotations

import re
from pathlib import Path

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import NAME_PATTERN
from drone_mesh.lab.program import PROGRAM

TEMPLATE = Path(__file__).resolve().parent / "experiment.template.yaml"


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
