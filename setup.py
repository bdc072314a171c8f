"""What catkin must know of the Python side; setup.cfg holds what only pip reads.

The version is defined in package.xml only: catkin refuses to build if the two differ.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from setuptools import find_packages, setup

HERE = Path(__file__).resolve().parent


def requirements(name: str) -> list[str]:
    """The requirements in requirements/NAME.txt, and in the files that it includes."""
    found: list[str] = []
    for line in (HERE / "requirements" / f"{name}.txt").read_text(encoding="utf-8").splitlines():
        requirement = line.partition("#")[0].strip()
        if requirement.startswith("-r "):
            found += requirements(requirement[3:][: -len(".txt")])
        elif requirement:
            found.append(requirement)
    return found


# The mesh's hot path, which mypyc can compile (docs/decisions.md, "The core may be compiled").
# Not in it: what users derive from, and classes with two bases.
HOT = {
    "channel": "access_rules medium_access packet_queue statistics trains",
    "communication": "neighbours timing",
    "communication/beacon": "connection courier disputes neighbour neighbourhood own_beacons"
    " packets plane routes times verdicts way_up",
    "communication/control": "delivery node_part pilot places router_states",
    "communication/events": "complaints",
    "communication/heartbeats": "connection delivery detours forwarding gateway_plane introduction"
    " node_search plane queued_delivery",
    "communication/node": "component gateway router snapshots whereabouts",
    "communication/routing": "child_table_tree",
    "communication/seals": "end_to_end replay seal",
    "communication/wire": "messages",
    "drone": "location",
    "inprocess": "clock drone node radio shared_air shared_antenna",
    "nrf24/emulator": "links space",
}
BUILD = Path("build/compiled/c")
FILES_AT_ONCE = 8


def batches(sources: list[str]) -> list[str]:
    """C files that include these: each start of the compiler reads Python's and mypyc's headers.

    Not all in one, for which a small machine has too little memory.
    """
    found = []
    for first in range(0, len(sources), FILES_AT_ONCE):
        batch = BUILD / f"batch_{first}.c"
        names = [Path(source).name for source in sources[first : first + FILES_AT_ONCE]]
        batch.write_text("".join(f'#include "{name}"\n' for name in names), encoding="utf-8")
        found.append(str(batch))
    return found


def compiled_core() -> dict[str, Any]:
    """Extension modules, if DRONE_MESH_COMPILE is set, as by scripts/compile."""
    if not os.environ.get("DRONE_MESH_COMPILE"):
        return {}
    from mypyc.build import mypycify

    modules = [f"src/drone_mesh/{room}/{name}.py" for room in HOT for name in HOT[room].split()]
    # Types of libraries would take time. No configuration: ours is for checks under Python 3.8.
    options = ["--config-file=", "--no-site-packages", "--ignore-missing-imports"]
    options.append("--cache-dir=build/compiled/cache")
    extensions = mypycify(
        [*options, *modules],
        opt_level="1",
        debug_level="0",
        multi_file=True,
        target_dir=str(BUILD),
        group_name="drone_mesh",
    )
    # A fused multiplication rounds otherwise than Python does; warnings are for who writes C.
    flags = [*extensions[-1].extra_compile_args, "-ffp-contract=off", "-Wno-error"]
    for extension in extensions:
        extension.extra_compile_args = flags
    extensions[0].sources = batches(extensions[0].sources)
    return {"ext_modules": extensions}


EXTRAS = (
    "console", "http", "lab", "mqtt", "parquet", "physics", "raspberry", "report", "rl",
    "simulation",
)  # fmt: skip

setup(
    name="drone_mesh",
    version=ElementTree.parse(str(HERE / "package.xml")).findtext("version"),
    packages=find_packages("src"),
    package_dir={"": "src"},
    package_data={
        "": [
            "*.csv",
            "*.html",
            "*.lua",
            "*.service",
            "*.yaml",
            "py.typed",
            "leaflet/*",
            "meshes/*",
            "static/*",
        ]
    },
    install_requires=requirements("base"),
    extras_require={extra: requirements(extra) for extra in EXTRAS},
    **compiled_core(),
)
