"""What catkin has to know about the Python side; setup.cfg holds what only pip reads.

The version stands in package.xml alone: catkin refuses to build when the two differ.
"""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

manifest = ElementTree.parse(str(Path(__file__).resolve().parent / "package.xml"))

setup(
    name="drone_mesh",
    version=manifest.findtext("version"),
    packages=find_packages("src"),
    package_dir={"": "src"},
)
