"""Sphinx configuration of the API reference: scripts/docs builds it into build/docs/."""

from __future__ import annotations

import builtins
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

from sphinx.addnodes import pending_xref

ROOT = Path(__file__).resolve().parents[2]

project = "drone_mesh"
author = "drone_mesh"
release = ElementTree.parse(str(ROOT / "package.xml")).findtext("version") or ""

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary"]
autosummary_generate = True
# What a package re-exports is described where it is defined.
autodoc_default_options = {
    "members": True,
    "undoc-members": True,  # a name and a signature may say it all
    "show-inheritance": True,
    "ignore-module-all": True,
}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_use_type_comments = False  # there are none, and each function is parsed for them
# ROS, hardware and the extras that are rarely installed are not needed to read the reference.
autodoc_mock_imports = [
    "actionlib",
    "diagnostic_msgs",
    "drone_mesh.msg",
    "drone_mesh.srv",
    "genpy",
    "geometry_msgs",
    "gpiod",
    "gymnasium",
    "pettingzoo",
    "pyarrow",
    "rosbag",
    "rosgraph",
    "rosgraph_msgs",
    "rospkg",
    "rospy",
    "rostopic",
    "spidev",
    "std_msgs",
    "tf2_msgs",
    "visualization_msgs",
]
templates_path = ["templates"]
exclude_patterns = ["templates"]
html_theme = "alabaster"
html_show_sphinx = False
html_show_copyright = False


# A name that a package re-exports, or that two modules define, is a target more than once.
suppress_warnings = ["ref.python"]


def plain_text(
    app: object, what: str, name: str, thing: object, options: object, lines: list
) -> None:
    """Docstrings here are plain text with `code` in backticks: escape what Sphinx interprets."""
    parts = re.split(r"`([^`]+)`", "\n".join(lines))
    parts[0::2] = [re.sub(r"[*|\\]|_(?=\W|$)", r"\\\g<0>", part) for part in parts[0::2]]
    parts[1::2] = [f"``{part}``" for part in parts[1::2]]
    paragraphs = "".join(parts).split("\n\n")
    lines[:] = "\n\n".join(map(lines_kept, paragraphs)).split("\n")


def lines_kept(paragraph: str) -> str:
    """A paragraph with indented lines is a table or a list: its lines stay as they are."""
    lines = paragraph.split("\n")
    if not any(line.startswith(" ") for line in lines):
        return paragraph
    return "\n".join(f"| {line}" for line in lines)


def without_names_of_others(app: object, doctree: object) -> None:
    """`int` and the like are no links: Sphinx would look for each of ten thousand in all names."""
    others = {*dir(builtins), *sys.modules} - {"drone_mesh"}
    for reference in list(doctree.findall(pending_xref)):  # type: ignore[attr-defined]
        first = reference["reftarget"].partition(".")[0]
        if reference.get("refdomain") == "py" and first in others:
            reference.replace_self(reference.children)


def setup(app: object) -> None:
    app.connect("autodoc-process-docstring", plain_text)  # type: ignore[attr-defined]
    app.connect("doctree-read", without_names_of_others)  # type: ignore[attr-defined]
