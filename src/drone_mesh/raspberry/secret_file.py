"""Reads a file that holds one secret: a token or a password."""

from __future__ import annotations

from pathlib import Path

from drone_mesh.errors import ConfigurationError


def read_secret(path: Path, what: str) -> str:
    """The text of the file, without white space around it. Raises ConfigurationError.

    `what`: the expected content, named in the error.
    """
    try:
        secret = path.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not a text file in UTF-8") from error
    if not secret:
        raise ConfigurationError(f"{path}: the file contains no {what}")
    return secret
