"""Which code, on which machine, produced a row of results."""

from __future__ import annotations

import ast
import datetime
import functools
import hashlib
import importlib.metadata
import platform
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterable, Iterator, NamedTuple, Sequence

if TYPE_CHECKING:
    from drone_mesh.lab.experiment import LoadedExperiment
_HERE = Path(__file__).resolve().parent
_PACKAGES = ("drone_mesh", "numpy", "pydantic", "scipy", "dask", "distributed", "matplotlib")
_INSTALLED = ("site-packages", "dist-packages")
_OWN_PACKAGE = "drone_mesh"  # its commit is in the version of the code


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


def code_with(own: str) -> str:
    """The code of a run that starts now: of this package, and of the user's modules (`own`)."""
    return f"{code_version()} {own}".rstrip()


def describe_session(command: list[str], loaded: LoadedExperiment, workers: str) -> dict[str, Any]:
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


class _Module(NamedTuple):
    name: str
    file: Path
    root: Path


def own_code(modules: Iterable[str], folder: str) -> str:
    """`half_way:1a2b3c4d` for each: a hash of its file and of all that it imports from the user.

    It tells runs of an edited strategy from older ones. The files are found as an import would find
    them, but no code runs. What a module loads by other means than an import statement is not seen.
    `folder`: the one of the experiment.
    """
    return " ".join(f"{name}:{_hash(name, folder)}" for name in sorted(set(modules)))


@functools.lru_cache(maxsize=None)
def imported_code(modules: tuple[str, ...], folder: str) -> str:
    """The same, as the modules were when this process imported them: at the first call."""
    return own_code(modules, folder)


def _hash(name: str, folder: str) -> str:
    found = _find(name, [*map(Path, sys.path), Path(folder)])
    if found is None:
        return "missing"
    roots = [Path(folder)]
    if found.root.name not in (*_INSTALLED, Path(sysconfig.get_paths()["stdlib"]).name):
        roots.append(found.root)
    seen: dict[str, _Module] = {}
    waiting = [found]
    while waiting:
        module = waiting.pop()
        if module.name in seen:
            continue
        seen[module.name] = module
        names = {name for name in _imports(module) if name.partition(".")[0] != _OWN_PACKAGE}
        waiting += filter(None, (_find(name, roots) for name in names))
    content = hashlib.sha256()
    for name, module in sorted(seen.items()):
        content.update(f"{name} ".encode() + module.file.read_bytes())
    return content.hexdigest()[:8]


def _find(name: str, roots: Sequence[Path]) -> _Module | None:
    for root in roots:
        path = root.joinpath(*name.split("."))
        for file in (path / "__init__.py", path.with_name(f"{path.name}.py")):
            if file.is_file():
                return _Module(name, file, root)
    return None


def _imports(module: _Module) -> Iterator[str]:
    """The names that it may import: modules, and what may be a module inside a package."""
    package = module.name.split(".")
    yield from (".".join(package[:depth]) for depth in range(1, len(package)))
    if module.file.name != "__init__.py":
        package.pop()
    try:
        tree = ast.parse(module.file.read_bytes())
    except (SyntaxError, ValueError):
        return  # whoever imports it says so
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) + 1 - node.level] if node.level else []
            base = [*start, *filter(None, [node.module])]
            yield ".".join(base)
            yield from (".".join([*base, alias.name]) for alias in node.names)
