"""Comments and docs cite documents and sections that are in this repository."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Callable

ROOT = Path(__file__).resolve().parents[2]
CODE = ("src", "test", "nodes", "scripts", "launch", "config", "msg", "srv", "examples")
SUFFIXES = {"", ".py", ".js", ".html", ".css", ".launch", ".test", ".xml", ".yaml", ".msg", ".srv"}

CITATION = re.compile(r'\b(docs/[\w-]+\.md)((?:,? (?:(?:and|or|to) )?"[^"]+")*)')
LINK = re.compile(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)")
# Citations of documents that are not in the repository.
ELSEWHERE = re.compile(
    r"\b[Rr]eference,? (?:sections? )?\d|\bSDD\b|\bformula \d|\bsections? \d"
    r"|\bChecklist row|(?<!docs/)\b(?:nrf24|lab|style|reference|sdd\.nl)\.md\b"
)


def code_files() -> list[Path]:
    return sorted(
        path
        for folder in CODE
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix in SUFFIXES and "__pycache__" not in path.parts
        if path != Path(__file__).resolve()
    )


def titles(document: Path) -> list[str]:
    """The titles of a document's sections, as they are written."""
    return re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), re.MULTILINE)


def anchor(title: str) -> str:
    """What a link to a section says after its hash sign."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def unwrapped(text: str) -> str:
    """The text with each comment on one line."""
    return re.sub(r"\n\s*(?:#|//)?\s*", " ", text)


def wrong_citations(text: str) -> list[str]:
    """What is cited in a text, and is not there."""
    wrong = []
    for document, sections in CITATION.findall(unwrapped(text)) if "docs/" in text else ():
        if not (ROOT / document).is_file():
            wrong.append(document)
            continue
        known = titles(ROOT / document)
        quoted = re.findall(r'"([^"]+)"', sections)
        wrong.extend(f'{document}, "{title}"' for title in quoted if title not in known)
    return wrong


def found_in_code(find: Callable[[str], list[str]]) -> dict[str, list[str]]:
    """What `find` finds in each file of the code, by its path; files without are left out."""
    found = {
        str(path.relative_to(ROOT)): find(path.read_text(encoding="utf-8", errors="replace"))
        for path in code_files()
    }
    return {path: finds for path, finds in found.items() if finds}


def test_each_cited_document_and_section_exists():
    assert found_in_code(wrong_citations) == {}


def test_no_comment_cites_a_document_outside_the_repository():
    assert found_in_code(ELSEWHERE.findall) == {}


def test_each_link_of_the_docs_leads_somewhere():
    broken = []
    for path in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]:
        for target, section in LINK.findall(path.read_text(encoding="utf-8")):
            document = (path.parent / target).resolve() if target else path
            if not document.exists():
                broken.append(f"{path.name}: {target}")
            elif section and section not in map(anchor, titles(document)):
                broken.append(f"{path.name}: {target}#{section}")
    assert broken == []


def test_each_picture_is_shown_in_a_document():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    for picture in (ROOT / "docs" / "pictures").iterdir():
        assert f"pictures/{picture.name})" in text, picture.name
