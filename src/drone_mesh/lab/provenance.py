"""Which code, on which machine, produced a row of results."""

from __future__ import annotations

import datetime
import functools
import hashlib
import importlib.metadata
import platform
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drone_mesh.lab.experiment import LoadedExperiment
    from drone_mesh.lab.plan import RunSpec

_HERE = Path(__file__).resolve().parent
_PACKAGES = ("drone_mesh", "numpy", "pydantic", "scipy", "dask", "distributed", "matplotlib")


@functools.lru_cache(maxsize=None)
def code_version() -> str:
    """The last commit of this checkout that changed the package; or the package version.

    With "+dirty." and a hash if files differ from it.
    """
    package = str(_HERE.parent)
    commit = _git("log", "-1", "--format=%h", "--abbrev=12", "--", package)
    if not commit:
        return _version("drone_mesh") or "unknown"
    changed = _git("diff", "HEAD", "--", package)
    if not changed:
        return commit
    return f"{commit}+dirty.{hashlib.sha256(changed.encode()).hexdigest()[:8]}"


def code_of(spec: RunSpec) -> str:
    """The code of a run that starts now: of this package, and of the user's modules."""
    return f"{code_version()} {spec.own_code}".rstrip()


def describe_session(command: list[str], loaded: LoadedExperiment, workers: str) -> dict[str, Any]:
    """One entry of provenance.json."""
    return {
        "started": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "command": command,
        "overrides": list(loaded.overrides),
        "folder": str(loaded.folder.resolve()),
        "experiment_hash": loaded.digest,
        "code": code_version(),
        "workers": workers,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "processor": platform.machine(),
        "packages": {name: _version(name) for name in _PACKAGES if _version(name)},
    }


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(_HERE), *arguments], capture_output=True, text=True, timeout=10
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
