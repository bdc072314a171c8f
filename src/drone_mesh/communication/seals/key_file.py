"""Reads and writes key files, inaccessible to other users of the machine."""

from __future__ import annotations

import os
from pathlib import Path

from drone_mesh.communication.seals.keys import MeshKey, NodeKeys, keys_from_text
from drone_mesh.errors import ConfigurationError
from drone_mesh.secret_file import read_secret_file


def read_key_file(path: Path) -> MeshKey | NodeKeys:
    """The keys in a secret file. Raises ConfigurationError if it is none or holds no keys."""
    text = read_secret_file(path)
    try:
        return keys_from_text(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def write_key_file(path: Path, keys: MeshKey | NodeKeys) -> None:
    """Create a file, mode 600. Raises ConfigurationError if it exists: keys are not overwritten."""
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(keys.to_text())
    except FileExistsError as error:
        raise ConfigurationError(
            f"key file {path}: exists already and is not overwritten; choose another name"
        ) from error
    except OSError as error:
        raise ConfigurationError(f"key file {path}: {error.strerror or error}") from error
