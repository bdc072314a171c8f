"""A YAML file with the line of each value, for error messages that point at it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Tuple, Union

import yaml

from drone_mesh.errors import ConfigurationError

Place = Tuple[Union[str, int], ...]
"""The position of a value: the keys and list indices that lead to it."""

Lines = Dict[Place, int]
"""The line of each value, from 1."""


def read_marked(path: Path) -> tuple[dict[str, Any], Lines]:
    """The mapping in this file, and the line of each key and list entry.

    Raises ConfigurationError (one line: file, line, what is wrong) for a file that cannot be read,
    is invalid YAML, has a duplicate key or is not a mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not a text file in UTF-8") from error
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        content = yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigurationError(f"{path}{line}: {error.problem}") from error
    except (yaml.YAMLError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {' '.join(str(error).split())}") from error
    if root is None or not isinstance(content, dict):
        raise ConfigurationError(f"{path}: expected 'key: value' lines")
    lines: Lines = {}
    _note_lines(path, root, (), lines)
    return content, lines


def nearest_line(lines: Lines, place: Place) -> int | None:
    """The line of this place, or of its innermost enclosing place in the file."""
    for end in range(len(place), 0, -1):
        if place[:end] in lines:
            return lines[place[:end]]
    return None


def _note_lines(path: Path, node: yaml.Node, place: Place, lines: Lines) -> None:
    if isinstance(node, yaml.MappingNode):
        for key_node, value_node in node.value:
            key = key_node.value
            here = (*place, key)
            line = key_node.start_mark.line + 1
            if here in lines:
                raise ConfigurationError(
                    f"{path}, line {line}: duplicate key {key}, first on line {lines[here]}"
                )
            lines[here] = line
            _note_lines(path, value_node, here, lines)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            lines[(*place, index)] = item.start_mark.line + 1
            _note_lines(path, item, (*place, index), lines)
