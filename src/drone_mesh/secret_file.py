"""Reads files with secrets: keys, tokens, passwords."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from drone_mesh.errors import ConfigurationError

_FOR_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_ROOT = 0


def read_secret_file(path: Path) -> str:
    """The text of a file that only its owner can access. Raises ConfigurationError.

    The owner is the user who runs this program, or root. Devices and pipes are refused unread.
    A credential of systemd (systemd.exec(5)) belongs to root, and an access list lets this user
    read it; that shows as a permission of the group.
    """
    try:
        # A pipe without a writer would otherwise block the program here.
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), encoding="utf-8-sig") as file:
            _check(path, os.fstat(file.fileno()))
            return file.read()
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: not a text file in UTF-8") from error


def read_secret(path: Path, what: str) -> str:
    """The text of a secret file, without white space around it. Raises ConfigurationError.

    `what`: the expected content, named in the error.
    """
    secret = read_secret_file(path).strip()
    if not secret:
        raise ConfigurationError(f"{path}: the file contains no {what}")
    return secret


def _check(path: Path, status: os.stat_result) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise ConfigurationError(f"{path}: Is a directory")
    if not stat.S_ISREG(status.st_mode):
        raise ConfigurationError(f"{path}: not a regular file")
    if status.st_uid not in (os.geteuid(), _ROOT):
        raise ConfigurationError(
            f"{path}: belongs to another user (id {status.st_uid}), who could change it; "
            f"run: chown {os.geteuid()} {path}"
        )
    mode = stat.S_IMODE(status.st_mode)
    if mode & (_FOR_OTHERS & ~stat.S_IRGRP if _is_credential(path, status) else _FOR_OTHERS):
        raise ConfigurationError(
            f"{path}: other users can access it (mode {mode:04o}); run: chmod 600 {path}"
        )


def _is_credential(path: Path, status: os.stat_result) -> bool:
    folder = os.environ.get("CREDENTIALS_DIRECTORY")
    if not folder or status.st_uid != _ROOT:
        return False
    return path.resolve().parent == Path(folder).resolve()
