"""The fenced blocks of README and docs, and how each of them is tested.

A comment line before a block, which is not shown, decides: `<!-- test: simulation -->` for commands
that test/rostest/test_documentation.py runs beside a simulation, `<!-- test: clone -->` for those
that start one, which test/rostest/test_installations.py runs in a copy of the checkout, and
`<!-- test: none, REASON -->` for what cannot run on a bare machine. A block of Python without a
comment is run by the unit tests.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Iterator, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]

_BLOCK = re.compile(
    r"(?:^<!-- test: (?P<test>[^\n]*) -->\n)?^```(?P<language>bash|python)\n(?P<text>.*?)^```$",
    flags=re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """One fenced block of bash or Python."""

    page: Path
    line: int  # of its first line, from 1
    language: str
    text: str
    test: str  # as the comment before it says; empty: no comment

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    def commands(self) -> Iterator[str]:
        """The lines of a block of bash, without their comments."""
        for line in self.text.splitlines():
            command = re.sub(r"(^|\s)#.*$", "", line).strip()
            if command:
                yield command


def blocks(language: str) -> list[Block]:
    """All blocks in this language, page by page."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in _BLOCK.finditer(text):
            if match["language"] == language:
                line = text.count("\n", 0, match.start("text")) + 1
                found.append(Block(page, line, language, match["text"], match["test"] or ""))
    return found
