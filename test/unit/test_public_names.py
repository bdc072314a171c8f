"""What users may import: it is there, the examples need nothing else, and no extra is needed."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fenced_blocks import ROOT, blocks  # noqa: E402

ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
TABLE = ARCHITECTURE.partition("## What users may import")[2].partition("\n## ")[0]
PUBLIC = re.findall(r"`(drone_mesh[\w.]*)`", "".join(re.findall(r"\n\| (`[^|]*)\|", TABLE)))
NEEDS_ROS = ("drone_mesh.ros", "drone_mesh.msg", "drone_mesh.srv")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SOURCES = {path.name: path.read_text(encoding="utf-8") for path in EXAMPLES}
SOURCES.update((str(block), block.text) for block in blocks("python"))
WITHOUT_EXTRAS = """
import sys

class OnlyTheBase:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in {"drone_mesh", "numpy"} | sys.stdlib_module_names:
            raise ImportError(f"{name} is not in requirements/base.txt")

sys.meta_path.insert(0, OnlyTheBase())
"""


def imported_names(source):
    """Module and name of each import of this package."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("drone_mesh"):
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if "drone_mesh" in alias.name)


def exported_by(module):
    """The names in `__all__` of a module, without importing it."""
    path = ROOT / "src" / Path(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return ast.literal_eval(node.value)
    raise AssertionError(f"{module} has no __all__")


@pytest.mark.parametrize("module", [name for name in PUBLIC if not name.startswith(NEEDS_ROS)])
def test_each_public_name_is_there(module):
    loaded = importlib.import_module(module)
    assert [name for name in exported_by(module) if not hasattr(loaded, name)] == []


def test_the_three_packages_for_users_are_in_the_table():
    assert {"drone_mesh", "drone_mesh.inprocess", "drone_mesh.lab"} <= set(PUBLIC)


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_examples_and_pages_import_only_public_names(source):
    for module, name in imported_names(source):
        if not module.startswith(NEEDS_ROS[1:]):
            assert module in PUBLIC, module
            assert name in exported_by(module), f"{module}.{name}"


@pytest.mark.slow
@pytest.mark.skipif(sys.version_info < (3, 10), reason="sys.stdlib_module_names")
@pytest.mark.parametrize("page", ["README.md", "docs/lab.md"])
def test_the_code_of_a_page_runs_without_extras(page, tmp_path):
    code = [block.text for block in blocks("python") if block.page == ROOT / page]
    base = [text for text in code if "render_page" not in text]
    assert base
    assert len(code) - len(base) <= 1  # the page about a run needs the extra `report`
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS + "".join(base)],
        cwd=str(tmp_path),
        env={"PYTHONPATH": str(ROOT / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.skipif(sys.version_info < (3, 10), reason="sys.stdlib_module_names")
def test_each_public_name_is_there_without_extras_but_those_that_the_page_excepts():
    excepted = {"drone_mesh.lab.env", "drone_mesh.nrf24.emulator.cooperative_clock"}
    exceptions = ARCHITECTURE.partition("has what they need, except")[2].partition(".\n")[0]
    need_extras = re.findall(r"`(\w+)`", exceptions)
    assert "lab" in need_extras
    modules = [m for m in PUBLIC if m not in excepted and not m.startswith(NEEDS_ROS)]
    lines = [
        f"from {module} import {name}"
        for module in modules
        for name in exported_by(module)
        if name not in need_extras
    ]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS + "\n".join(lines)],
        env={"PYTHONPATH": str(ROOT / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout


def test_the_base_of_an_installation_is_what_its_file_lists():
    lines = (ROOT / "requirements" / "base.txt").read_text(encoding="utf-8").splitlines()
    assert [re.match(r"\w*", line)[0] for line in lines if not line.startswith("#")] == ["numpy"]
    assert 'install_requires=requirements("base")' in (ROOT / "setup.py").read_text()
