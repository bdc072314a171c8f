"""What is in the checkout must also be in an installation, with or without catkin."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[2]


def files_below(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc" and not path.name.startswith(".")
    }


def ros_imports(source: Path) -> set[str]:
    """The ROS packages that it imports."""
    line = r"^ *(?:from|import) (genpy|ros\w+|tf2?|\w+_msgs)\b"
    return set(re.findall(line, source.read_text(encoding="utf-8"), re.MULTILINE))


def test_the_help_of_the_wheel_names_every_extra() -> None:
    (extras,) = re.findall(r"^EXTRAS = \((.+?)\)", (ROOT / "setup.py").read_text(), re.M | re.S)
    text = (ROOT / "scripts" / "wheel").read_text()
    named = set(re.findall(r"\w+", text.partition("Other extras: ")[2].partition(".")[0]))
    assert named | {"raspberry"} == set(re.findall(r'"(\w+)"', extras))


@pytest.mark.slow
def test_the_console_extra_has_every_package_that_the_console_imports() -> None:
    def packages(*names: str) -> set[str]:
        lines = "".join((ROOT / "requirements" / f"{name}.txt").read_text() for name in names)
        return set(re.findall(r"^[a-z][a-z0-9_-]*", lines, re.MULTILINE))

    program = "import sys, drone_mesh.console.gateway_command; print(*sys.modules)"
    command = [sys.executable, "-c", program]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    said = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    used = {name.partition(".")[0] for name in said.stdout.split()}
    named = packages("console", "simulation", "lab", "report", "raspberry")
    assert used & named - packages("console") == set()


@pytest.mark.slow
def test_each_file_of_the_python_package_is_installed(tmp_path: Path) -> None:
    command = [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(tmp_path)]
    subprocess.run(command, cwd=str(ROOT), check=True, capture_output=True)
    # Nothing else in src/ counts: pip leaves its notes there (drone_mesh.egg-info).
    assert [path.name for path in tmp_path.iterdir()] == ["drone_mesh"]
    # By scripts/message_stubs; some versions of setuptools take them along.
    made_for_mypy = {"msg.pyi", "srv.pyi"}
    files = files_below(ROOT / "src" / "drone_mesh") - made_for_mypy
    assert files_below(tmp_path / "drone_mesh") - made_for_mypy == files


def test_each_program_in_nodes_is_installed() -> None:
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    cmake = cmake.replace("${PROJECT_NAME}", "drone_mesh")
    programs = re.findall(r"^  (nodes/[\w-]+)$", cmake, flags=re.MULTILINE)
    assert programs == sorted(f"nodes/{path.name}" for path in (ROOT / "nodes").iterdir())


def test_each_folder_that_ros_reads_is_installed() -> None:
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    cmake = cmake.replace("${PROJECT_NAME}", "drone_mesh")
    (folders,) = re.findall(r"^install\(DIRECTORY ([\w/ ]+)$", cmake, flags=re.MULTILINE)
    read_by_ros = {"config", "launch", "meshes", "rviz"} & {path.name for path in ROOT.iterdir()}
    assert {Path(folder).name for folder in folders.split()} >= read_by_ros
    assert all((ROOT / folder).is_dir() for folder in folders.split())


def third_party_imports(source: Path) -> set[str]:
    """The packages that it imports, except for those of Python."""
    found = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.partition(".")[0])
    return found - set(sys.stdlib_module_names) - {"drone_mesh"}


@pytest.mark.skipif(sys.version_info < (3, 10), reason="sys.stdlib_module_names")
def test_each_package_that_is_imported_is_declared_or_named_as_one_for_pip() -> None:
    text = (ROOT / "package.xml").read_text(encoding="utf-8")
    manifest = ElementTree.fromstring(text)
    declared = {
        (element.text or "").replace("python3-", "").lower()
        for element in manifest
        if element.tag.endswith("depend")
    }
    (by_pip,) = re.findall(r"<!-- By pip.*?known:(.*?)-->", text, re.DOTALL)
    imported = {
        name
        for source in (ROOT / "src" / "drone_mesh").rglob("*.py")
        for name in third_party_imports(source)
    }
    for name in sorted(imported):
        key = {"PIL": "pil"}.get(name, name)
        assert key in declared or re.search(rf"\b{key}\b", by_pip), name
    for name in re.findall(r"[a-z]\w+", by_pip.replace("paho-mqtt", "")):
        assert name in imported | {"websockets"}, f"{name} is not imported"
        assert name not in declared, name


def test_each_ros_package_that_is_used_is_declared() -> None:
    manifest = ElementTree.parse(str(ROOT / "package.xml"))
    depends = [element for element in manifest.getroot() if element.tag.endswith("depend")]
    declared = {(element.text or "").replace("python3-", "") for element in depends}
    sources = [*(ROOT / "src").rglob("*.py"), *(ROOT / "test" / "rostest").glob("*.py")]
    imported = {name for source in sources for name in ros_imports(source)}
    launched = {
        match
        for launch in [*(ROOT / "launch").rglob("*.launch"), *ROOT.glob("test/rostest/*.test")]
        for match in re.findall(r'pkg="(\w+)"', launch.read_text(encoding="utf-8"))
    }
    ours = {"drone_mesh", *(source.stem for source in sources)}
    assert (imported | launched) - ours <= declared
