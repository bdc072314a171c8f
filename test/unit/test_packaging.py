"""What is in the checkout must also be in an installation, with or without catkin."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def files_below(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc" and not path.name.startswith(".")
    }


def test_each_file_of_the_python_package_is_installed(tmp_path: Path) -> None:
    command = [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(tmp_path)]
    subprocess.run(command, cwd=str(ROOT), check=True, capture_output=True, timeout=60)
    assert files_below(tmp_path) == files_below(ROOT / "src")


def test_each_program_in_nodes_is_installed() -> None:
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    programs = re.findall(r"^  (nodes/\w+)$", cmake, flags=re.MULTILINE)
    assert programs == sorted(f"nodes/{path.name}" for path in (ROOT / "nodes").iterdir())


def test_each_folder_that_ros_reads_is_installed() -> None:
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    (folders,) = re.findall(r"^install\(DIRECTORY ([\w ]+)$", cmake, flags=re.MULTILINE)
    read_by_ros = {"config", "launch", "rviz"} & {path.name for path in ROOT.iterdir()}
    assert set(folders.split()) >= read_by_ros
