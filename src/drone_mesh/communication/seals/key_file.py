"""Reads and writes key files, inaccessible to other users of the machine."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from drone_mesh.communication.seals.keys import MeshKey, NodeKeys, keys_from_text
from drone_mesh.errors import ConfigurationError

_FOR_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def read_key_file(path: Path) -> MeshKey | NodeKeys:
    """The keys in a file. Raises ConfigurationError if others may read it or it holds no keys."""
    try:
        with open(path, encoding="ascii") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            if mode & _FOR_OTHERS:
                raise ConfigurationError(
                    f"{path}: other users can access it (mode {mode:04o}); run: chmod 600 {path}"
                )
            text = file.read()
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not a text file") from error
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
