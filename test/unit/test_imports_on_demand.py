"""What only one program needs is loaded by that program only, and not before it is asked for."""

from __future__ import annotations

import ast
import functools
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
WEB = {"fastapi", "fastapi_offline", "pydantic", "starlette", "uvicorn", "websockets"}
REPORT = {"jinja2", "matplotlib"}
SIMULATION = {"numpy", "pybullet", "rospy"}
AUTOPILOT = {"pymap3d", "pymavlink"}
# Without hardware the extra `http` is enough (docs/raspberry-pi.md): spidev needs a compiler.
OF_A_PI = {"cryptography", "gpiod", "greenlet", "paho", "serial", "spidev", "yaml"}
NODE = {"drone_mesh.communication.node.component"}  # the software of a node of the mesh
TECHNIQUES = {"drone_mesh.communication.repair.strategies", "drone_mesh.communication.routing"}


@functools.lru_cache(maxsize=None)
def imports_when_loaded(source: Path) -> set[str]:
    """What loading this file imports; not what its functions import when they are called."""
    found: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(source.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            waiting += node.orelse
        elif not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            waiting += ast.iter_child_nodes(node)
    return found


def loaded_by(program: Path) -> set[str]:
    """What is loaded when this program starts, through our own modules; also each package."""
    packages: set[str] = set()
    seen: set[Path] = set()
    waiting = [program]
    while waiting:
        source = waiting.pop()
        if source in seen:
            continue
        seen.add(source)
        for name in imports_when_loaded(source):
            packages |= {name, name.split(".")[0]}
            parts = name.split(".")
            for length in range(1, len(parts) + 1):
                path = (ROOT / "src").joinpath(*parts[:length])
                files = (path.with_suffix(".py"), path / "__init__.py")
                waiting += [file for file in files if file.exists()]
    return packages


@pytest.mark.parametrize(
    ("program", "unwanted"),
    [
        ("drone_factory", WEB | REPORT | {"numpy"}),  # internet:=mock, the default
        ("mesh_host", WEB | REPORT | {"numpy"}),
        ("drone_manager", NODE | WEB | REPORT),
        ("wireless_signal_simulator", NODE | TECHNIQUES | WEB | REPORT | {"numpy"}),
        ("status", NODE | TECHNIQUES | WEB | REPORT | {"numpy", "rosbag"}),
        ("layout", NODE | TECHNIQUES | WEB | REPORT | {"rosbag"}),
        ("fly_actions", NODE | WEB | REPORT | {"numpy"}),
        ("mesh_markers", NODE | TECHNIQUES | WEB | REPORT | {"numpy"}),
        ("console", NODE | REPORT | {"fastapi", "pybullet", "rosbag"}),
        ("report", WEB | {"pybullet"}),
        ("raspberry_router", WEB | REPORT | SIMULATION | AUTOPILOT),
        ("raspberry_gateway", WEB | REPORT | SIMULATION | AUTOPILOT | OF_A_PI),
        ("mesh_send", NODE | TECHNIQUES | SIMULATION),
    ],
)
def test_a_program_does_not_load_what_only_others_need(program: str, unwanted: set[str]) -> None:
    assert loaded_by(ROOT / "nodes" / program) & unwanted == set()


@pytest.mark.parametrize("module", ["raspberry.program", "inprocess.network"])
def test_no_web_server_is_in_memory_before_it_is_asked_for(module: str) -> None:
    code = f"import sys, drone_mesh.{module}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(ROOT / "src")},
        check=True,
        capture_output=True,
        text=True,
    )
    assert {name.split(".")[0] for name in done.stdout.split()} & (WEB | REPORT) == set()


def test_a_gateway_with_http_loads_the_web_server() -> None:
    """The reading above would also pass if it followed no import at all."""
    assert loaded_by(ROOT / "src/drone_mesh/internet/http_internet.py") >= {"fastapi", "uvicorn"}
