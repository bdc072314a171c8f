"""Reads a YAML file written by a user, with errors that the user can act on."""

from __future__ import annotations

import itertools
import stat
from collections.abc import Hashable
from pathlib import Path
from typing import Any, Tuple

import yaml
from yaml.composer import ComposerError
from yaml.constructor import ConstructorError

from drone_mesh.arguments import is_decimal, is_whole
from drone_mesh.errors import ConfigurationError

# Far above what a configuration or a layout of 254 drones needs, and low enough to refuse
# a wrong or hostile file at once.
MAX_FILE_BYTES = 500_000
MAX_DEPTH = 10
MAX_VALUE_CHARACTERS = 250
MAX_SHARING_CHARACTERS = 5_000  # of a value in a file that may share parts by aliases
MAX_VALUES = 50_000  # with those that aliases repeat

INT_TAG, FLOAT_TAG = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
TEXT_TAG = "tag:yaml.org,2002:str"
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


def read_mapping(path: str | Path, shares: bool = False) -> YamlFile:
    """Read this file like read_mapping_text; also raises ConfigurationError if unreadable."""
    return read_mapping_text(read_text(path, pipe=shares), path, shares)


def read_mapping_text(text: str, path: str | Path, shares: bool = False) -> YamlFile:
    """The mapping in this text of a file; an empty file is an empty mapping.

    `path` is for messages. Raises ConfigurationError (one line: file, line, what is wrong) for
    invalid YAML, duplicate keys, exceeded limits (above) and anything but a mapping; also for
    numbers that YAML reads otherwise than people, such as 010, and for tags. Only if it `shares`
    parts by aliases (*name) and <<, these are allowed, and values may be long.
    """
    try:
        loader = _Loader(text, shares)
        root = loader.get_single_node()
        if root is not None and _expanded(root, {}) > MAX_VALUES:
            raise ConfigurationError(f"{path}: with aliases (*name) more than {MAX_VALUES} values")
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


def read_value(text: str) -> Any:
    """The value that a file would have in this text. Raises ConfigurationError."""
    return read_mapping_text(f"value: {text}", "value").content["value"]


def read_text(path: str | Path, pipe: bool = False, most_bytes: int = MAX_FILE_BYTES) -> str:
    """Raises ConfigurationError, also for a large file, a device and, unless allowed, a `pipe`."""
    try:
        if not pipe:
            _check_kind(Path(path))
        with Path(path).open("rb") as file:
            content = file.read(most_bytes + 1)
        if len(content) > most_bytes:
            raise ConfigurationError(f"{path}: larger than {most_bytes} bytes")
        return content.decode("utf-8-sig")
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not a text file in UTF-8") from error


def _check_kind(path: Path) -> None:
    mode = path.stat().st_mode  # opening a pipe waits for its writer
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise ConfigurationError(f"{path}: not a regular file")


def _expanded(node: yaml.Node, known: dict[int, int]) -> int:
    """The number of nodes, with those that aliases repeat. Raises RecursionError for a cycle."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in known:
        is_mapping = isinstance(node, yaml.MappingNode)
        parts = itertools.chain.from_iterable(node.value) if is_mapping else node.value
        known[id(node)] = 1 + sum(_expanded(part, known) for part in parts)
    return known[id(node)]


def _is_as_read(node: yaml.ScalarNode) -> bool:
    """Whether YAML 1.1 reads a number as people do: not 1_000, 010, 1:30, 1e6.

    Who takes the number refuses .inf and .nan, and says what is expected there.
    """
    text = node.value.lstrip("+")
    if node.tag == INT_TAG:
        return is_whole(text) and (text.lstrip("-")[0] != "0" or not text.lstrip("-0"))
    if node.tag == TEXT_TAG and not node.style:
        return not is_decimal(text)
    return node.tag != FLOAT_TAG or is_decimal(text) or text.lower().endswith((".inf", ".nan"))


class _Loader(yaml.SafeLoader):
    """SafeLoader with limits, which refuses duplicate keys (SafeLoader would use the last one)."""

    def __init__(self, text: str, shares: bool) -> None:
        super().__init__(text)
        self._shares = shares
        self._depth = 0
        self._values = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        mark: Any = event.start_mark
        if isinstance(event, yaml.AliasEvent) and not self._shares:
            raise ComposerError(None, None, "aliases (*name) are not allowed", mark)
        if self._depth >= MAX_DEPTH:
            problem = f"nested deeper than {MAX_DEPTH} levels"
            raise ComposerError(None, None, problem, mark)
        if self._values >= MAX_VALUES:
            raise ComposerError(None, None, f"more than {MAX_VALUES} values", mark)
        if getattr(event, "tag", None) is not None:
            raise ComposerError(None, None, f"tags are not allowed: {event.tag[:40]}", mark)
        longest = MAX_SHARING_CHARACTERS if self._shares else MAX_VALUE_CHARACTERS
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > longest:
            problem = f"a value is longer than {longest} characters"
            raise ComposerError(None, None, problem, mark)
        self._depth += 1
        self._values += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        if isinstance(node, yaml.ScalarNode) and not _is_as_read(node):
            problem = f"{node.value[:40]} is not a number in decimal digits"
            if node.tag == TEXT_TAG:
                problem = f"{node.value[:40]} is a text in YAML: write it as in 1.0e+6, or quoted"
            raise ComposerError(None, None, problem, mark)
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
            if key_node.tag == MERGE_TAG and self._shares:
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
