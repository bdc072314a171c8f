"""The places in an experiment file: errors that point to them, and values put there by a path."""

import difflib
from pathlib import Path
from typing import Any, Dict, List, Sequence, Union

from pydantic import BaseModel, ValidationError
from typing_extensions import get_args

from drone_mesh.arguments import MOST, is_up_to
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


class NoSuchPlace(Exception):
    """A dotted path that does not exist."""


def put(content: Any, path: str, value: Any) -> KeyPath:
    """Set the value at a dotted path. A step into the faults is an index or an action's name."""
    place: List[Union[str, int]] = []
    steps = path.split(".")
    for index, step in enumerate(steps):
        last = index == len(steps) - 1
        key: Union[str, int] = step
        if isinstance(content, list):
            try:
                key = _index_of(content, step)
            except NoSuchPlace:
                raise NoSuchPlace(f"{'.'.join(steps[:index])} has no entry {step}") from None
            if not is_up_to(step, MOST):  # an action's name leads into the fault and the action
                place.append(key)
                content, key = content[int(key)], step
        elif not isinstance(content, dict):
            raise NoSuchPlace(f"{'.'.join(steps[:index])} is a value and has no key {step}")
        place.append(key)
        if last:
            content[key] = value
        elif isinstance(content, dict):
            content = content.setdefault(str(key), {})
        else:
            content = content[int(key)]
    return tuple(place)


def _index_of(entries: Sequence[Any], step: str) -> int:
    if is_up_to(step, MOST):
        if int(step) >= len(entries):
            raise NoSuchPlace
        return int(step)
    for index, entry in enumerate(entries):
        if isinstance(entry, dict) and step in entry:
            return index
    raise NoSuchPlace
