"""Sets the value at a dotted path, such as `faults.kill.share`, in the content of a file."""

from typing import Any, List, Sequence, Union

from drone_mesh.arguments import MOST, is_up_to
from drone_mesh.yaml_file import KeyPath


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
