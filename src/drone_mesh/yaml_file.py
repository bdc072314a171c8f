"""Reads a YAML file written by a user, with errors that the user can act on."""

from __future__ import annotations

import stat
from collections.abc import Hashable
from pathlib import Path
from typing import Any, Tuple

import yaml
from yaml.composer import ComposerError
from yaml.constructor import ConstructorError

from drone_mesh.errors import ConfigurationError

# Our choices: far above what a configuration or a layout of 254 drones needs, and low enough to
# refuse a wrong or hostile file at once.
MAX_FILE_BYTES = 500_000
MAX_DEPTH = 10
MAX_VALUE_CHARACTERS = 250

MERGE_TAG = "tag:yaml.org,2002:merge"  # of the key <<

KeyPath = Tuple[Hashable, ...]


class YamlFile:
    """The mapping in a file, and the lines of its keys and list entries."""

    def __init__(
        self, path: str | Path, content: dict[Any, Any], lines: dict[KeyPath, int]
    ) -> None:
        self.path = path
        self.content = content
        self._lines = lines

    def where(self, *keys: Hashable) -> str:
        """Path and line of a key, given by the keys and indices that lead to it, for an error.

        For a key that is not in the file: the line of the nearest enclosing one.
        """
        for length in range(len(keys), 0, -1):
            line = self._lines.get(keys[:length])
            if line is not None:
                return f"{self.path}, line {line}"
        return str(self.path)


def is_number(value: object) -> bool:
    """Whether this value in a file is a number; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_whole_up_to(value: object, most: int) -> bool:
    """Whether this value in a file is a whole number 0..`most`."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= most


def read_mapping(path: str | Path, limited: bool = True) -> YamlFile:
    """Read this file like read_mapping_text; also raises ConfigurationError if unreadable."""
    return read_mapping_text(read_text(path, limited), path, limited)


def read_mapping_text(text: str, path: str | Path, limited: bool = True) -> YamlFile:
    """The mapping in this text of a file; an empty file is an empty mapping.

    `path` is for messages. Raises ConfigurationError (one line: file, line, what is wrong) for
    invalid YAML, duplicate keys and anything but a mapping. If `limited`, also for exceeded limits
    (above) and for aliases (*name), because a few lines of them can expand to gigabytes.
    """
    try:
        loader = _Loader(text, limited)
        root = loader.get_single_node()
        lines: dict[KeyPath, int] = {}
        if root is not None:
            loader.note_lines(root, (), lines)
        content = {} if root is None else loader.construct_document(root)
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigurationError(f"{path}{line}: {error.problem}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {' '.join(str(error).split())}") from error
    if content is None:
        content = {}
    if not isinstance(content, dict):
        kind = "list" if isinstance(content, list) else "single value"
        raise ConfigurationError(f"{path}: expected 'key: value' lines, not a {kind}")
    return YamlFile(path, content, lines)


def read_text(path: str | Path, limited: bool = True) -> str:
    """Raises ConfigurationError; if `limited`, also for a large file, a pipe or a device."""
    try:
        if limited:
            _check_size(Path(path))
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not a text file in UTF-8") from error


def _check_size(path: Path) -> None:
    status = path.stat()
    # Opening a pipe waits for its writer, and a device may never end.
    if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
        raise ConfigurationError(f"{path}: not a regular file")
    if status.st_size > MAX_FILE_BYTES:
        raise ConfigurationError(f"{path}: larger than {MAX_FILE_BYTES} bytes")


class _Loader(yaml.SafeLoader):
    """SafeLoader with limits, which refuses duplicate keys (SafeLoader would use the last one)."""

    def __init__(self, text: str, limited: bool) -> None:
        super().__init__(text)
        self._limited = limited
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if not self._limited:
            return super().compose_node(parent, index)
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        mark: Any = event.start_mark
        if isinstance(event, yaml.AliasEvent):
            raise ComposerError(None, None, "aliases (*name) are not allowed", mark)
        if self._depth >= MAX_DEPTH:
            problem = f"nested deeper than {MAX_DEPTH} levels"
            raise ComposerError(None, None, problem, mark)
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > MAX_VALUE_CHARACTERS:
            problem = f"a value is longer than {MAX_VALUE_CHARACTERS} characters"
            raise ComposerError(None, None, problem, mark)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def note_lines(self, node: yaml.Node, keys: KeyPath, lines: dict[KeyPath, int]) -> None:
        """Record the line of each key and list entry; ConstructorError for a duplicate key."""
        if isinstance(node, yaml.SequenceNode):
            for index, entry in enumerate(node.value):
                lines[(*keys, index)] = entry.start_mark.line + 1
                self.note_lines(entry, (*keys, index), lines)
            return
        if not isinstance(node, yaml.MappingNode):
            return
        for key_node, value_node in node.value:
            if key_node.tag == MERGE_TAG and not self._limited:
                continue  # its keys come from another mapping
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                continue  # construct_document refuses it
            path = (*keys, key)
            if path in lines:
                problem = f"duplicate key {key}, first on line {lines[path]}"
                raise ConstructorError(None, None, problem, key_node.start_mark)
            lines[path] = key_node.start_mark.line + 1
            self.note_lines(value_node, path, lines)
