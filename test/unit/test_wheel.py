"""The wheel works in an environment that has nothing else."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pip
import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = ("LICENSE", "README.md", "package.xml", "pyproject.toml", "setup.cfg", "setup.py")


def run(*command: object, cwd: Path) -> str:
    """What the command prints; if the command fails, fails with its output."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "PIP_"))}
    done = subprocess.run(
        [str(word) for word in command],
        cwd=str(cwd),
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture
def installed(tmp_path):
    """The folder of a new virtual environment in which only the wheel is installed."""
    checkout, venv = tmp_path / "checkout", tmp_path / "venv"
    checkout.mkdir()  # building leaves files in the checkout that it builds from
    for name in FILES:
        shutil.copy(ROOT / name, checkout / name)
    for name in ("config", "nodes", "requirements", "src"):
        ignored = shutil.ignore_patterns("*.egg-info", "__pycache__")
        shutil.copytree(ROOT / name, checkout / name, ignore=ignored)
    pip_here = (sys.executable, "-m", "pip", "--disable-pip-version-check")
    no_network = ("--no-deps", "--no-build-isolation", "--no-index")
    run(*pip_here, "wheel", *no_network, "--wheel-dir", checkout / "dist", checkout, cwd=checkout)
    (wheel,) = (checkout / "dist").glob("drone_mesh-*-py3-none-any.whl")
    run(sys.executable, "-m", "venv", "--without-pip", venv, cwd=tmp_path)
    pip_there = (venv / "bin/python", Path(pip.__file__).parent, "--disable-pip-version-check")
    run(*pip_there, "install", "--no-deps", "--no-index", "--no-compile", wheel, cwd=venv)
    return venv


@pytest.mark.slow
def test_in_an_empty_environment_the_programs_of_a_pi_start_and_all_files_are_there(installed):
    for program in ("raspberry_router", "raspberry_gateway"):
        assert f"usage: {program}" in run(installed / "bin" / program, "--help", cwd=installed)
    mesh_and_radio = "import drone_mesh.communication.node.assembly, drone_mesh.nrf24.high_level"
    run(installed / "bin/python", "-c", mesh_and_radio, cwd=installed)
    (package,) = installed.glob("lib/python3*/site-packages/drone_mesh")
    assert (package / "console/static/index.html").is_file()  # test_packaging.py looks for each
    assert (installed / "share/drone_mesh/systemd/raspberry_router.service").is_file()
    assert (installed / "share/drone_mesh/config/casus.yaml").is_file()
    (metadata,) = package.parent.glob("drone_mesh-*.dist-info/METADATA")
    extras = re.findall(r"^Provides-Extra: (\w+)$", metadata.read_text(), flags=re.MULTILINE)
    assert {"raspberry", "simulation", "console", "http", "report"} <= set(extras)
