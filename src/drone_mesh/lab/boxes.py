"""A file of obstacles: the boxes that stand in the world."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.marked_yaml import read_marked


def rows_of_file(path: Path) -> list[dict[str, Any]]:
    """Its boxes, unchecked. Raises ConfigurationError: file, line and what is wrong."""
    content, lines = read_marked(path)
    extra = [key for key in content if key != "boxes"]
    if extra:
        line = lines[(extra[0],)]
        raise ConfigurationError(f"{path}, line {line}: unknown key {extra[0]}; expected boxes")
    found = content.get("boxes")
    if not isinstance(found, list):
        raise ConfigurationError(f"{path}: expected 'boxes:' with a list")
    return found
