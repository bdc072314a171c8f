"""The source of an experiment's content, for errors that point into the file or at an argument."""

import difflib
from pathlib import Path
from typing import Any, Dict, List, Sequence

from pydantic import BaseModel, ValidationError
from typing_extensions import get_args

from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import KeyPath, YamlFile


class Source:
    """Creates errors that point into the file, or at the argument that overrode it."""

    def __init__(self, file: YamlFile, folder: Path) -> None:
        self.folder = folder
        self.overrides: Dict[KeyPath, str] = {}
        self._file = file

    def error(self, place: KeyPath, message: str) -> ConfigurationError:
        """The error to raise about the value at `place`."""
        for end in range(len(place), 0, -1):
            if place[:end] in self.overrides:
                return ConfigurationError(f"argument {self.overrides[place[:end]]}: {message}")
        return ConfigurationError(f"{self._file.where(*place)}: {message}")

    def error_of(
        self, error: ValidationError, before: KeyPath, model: Any, shown: KeyPath = ()
    ) -> ConfigurationError:
        """The first problem that pydantic found, as one line. `shown`: where to point instead."""
        first = error.errors()[0]
        inside: KeyPath = tuple(first["loc"])
        key = ".".join(map(str, (*before, *inside))) or "the file"
        kind = first["type"]
        if kind == "extra_forbidden":
            name, known = str(inside[-1]), _keys_at(model, inside[:-1])
            message = f"unknown key {key}; {nearest_name(name, known)}"
        elif kind == "missing":
            message = f"missing key {key}"
        else:
            words = str(first["msg"]).replace("Value error, ", "")
            value = first.get("input")
            tail = f", not {value!r}" if isinstance(value, (str, int, float, bool)) else ""
            message = f"{key}: {words[:1].lower()}{words[1:]}{tail}"
        return self.error(shown or (*before, *inside), message)


def nearest_name(name: str, known: Sequence[str]) -> str:
    """A hint for an unknown name: the closest one, or all of them."""
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]}?" if close else f"known keys: {', '.join(sorted(known))}"


def _keys_at(model: Any, place: KeyPath) -> List[str]:
    for step in place:
        if isinstance(step, int):
            continue
        fields = getattr(model, "model_fields", {})
        model = _model_in(fields[step].annotation) if step in fields else None
    return list(getattr(model, "model_fields", {}))


def _model_in(annotation: Any) -> Any:
    """The model class inside Optional[...] or List[...]."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)
