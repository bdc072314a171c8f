"""What catkin must know of the Python side; setup.cfg holds what only pip reads.

The version is defined in package.xml only: catkin refuses to build if the two differ.
"""

from __future__ import annotations

from pathlib import Path
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
)
