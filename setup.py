"""What catkin has to know about the Python side; setup.cfg holds what only pip reads.

The version stands in package.xml alone: catkin refuses to build when the two differ.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

HERE = Path(__file__).resolve().parent


def requirements(name: str) -> list[str]:
    lines = (HERE / "requirements" / name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


setup(
    name="drone_mesh",
    version=ElementTree.parse(str(HERE / "package.xml")).findtext("version"),
    packages=find_packages("src"),
    package_dir={"": "src"},
    package_data={"": ["*.csv", "*.html", "*.service", "static/*"]},
    extras_require={
        "raspberry": requirements("raspberry.txt"),
        "simulation": requirements("simulation.txt"),
    },
)
