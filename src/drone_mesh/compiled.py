"""The compiled core: what scripts/compile has built of the mesh's hot path, if it fits.

A build belongs to the sources of its rooms, byte for byte, and to one Python. An import of the
package looks for the build of what lies here now, and uses all of it or nothing: after an edit,
Python runs the sources.
"""

from __future__ import annotations

import hashlib
import os
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, TypeVar

if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr as mypyc_attr
else:
    _Class = TypeVar("_Class")

    def mypyc_attr(**_marks: bool) -> Callable[[_Class], _Class]:
        """Marks a class for mypyc, such as one that users derive from; without it, nothing."""
        return lambda marked: marked


PACKAGE = Path(__file__).resolve().parent
BUILDS = PACKAGE.parents[1] / "build" / "compiled"
ROOMS = ("channel", "communication", "drone", "inprocess", "nrf24")  # that hold compiled modules
WISH = "DRONE_MESH_CORE"  # python: never a build; compiled: nothing else


def build() -> Path:
    """Where the build of these sources is, if there is one."""
    content = hashlib.sha256(EXTENSION_SUFFIXES[0].encode())
    for source in sorted(file for room in ROOMS for file in (PACKAGE / room).rglob("*.py")):
        content.update(f"{source.relative_to(PACKAGE)}\n".encode() + source.read_bytes())
    return BUILDS / content.hexdigest()[:16]


class _Finder(MetaPathFinder):
    """Finds the modules of a build before their sources."""

    def __init__(self, folder: Path) -> None:
        names = {file: file.relative_to(folder).as_posix() for file in folder.rglob("*.so")}
        self._files = {name.split(".")[0].replace("/", "."): file for file, name in names.items()}

    def find_spec(self, name: str, *_where: Any) -> ModuleSpec | None:
        file = self._files.get(name)
        return None if file is None else spec_from_file_location(name, file)


def use_build() -> None:
    """Let imports find the build that fits; before anything else of the package is imported."""
    wish = os.environ.get(WISH)
    if wish not in (None, "", "python", "compiled"):
        raise ImportError(f"{WISH}={wish}: expected python or compiled")
    if wish == "python" or not (BUILDS.is_dir() or wish):
        return
    folder = build()
    if folder.is_dir():
        sys.meta_path.insert(0, _Finder(folder))
    elif wish:
        raise ImportError(f"{WISH}={wish}: no build of these sources; see scripts/compile")


def core() -> str:
    """Which core runs, in words."""
    if "drone_mesh__mypyc" in sys.modules:
        return "compiled"
    if not (PACKAGE.parents[1] / "scripts" / "compile").is_file():
        return "Python"
    return "Python (for one that is faster: scripts/compile, after each change of its sources)"
