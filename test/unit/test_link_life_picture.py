"""scripts/make_link_life_picture.py: it replaces its picture only by one of results."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "make_link_life_picture.py"
HEADER = "routing,mobility.speed_m_s,link_life_s,pdr_up,pdr_down\n"


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "PICTURE", tmp_path / "picture.png")
    return module


def make(script: ModuleType, monkeypatch: pytest.MonkeyPatch, *folders: Path) -> None:
    monkeypatch.setattr(sys, "argv", [SCRIPT.name, *map(str, folders)])
    script.main()


def test_the_picture_is_made_of_all_results(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "runs.csv").write_text(f"{HEADER}beacon,0.3,41,0.9,0.8\nbabel,0.3,41,0.5,0.4\n")
    make(script, monkeypatch, tmp_path, tmp_path)
    assert script.PICTURE.read_bytes().startswith(b"\x89PNG")


def test_without_results_it_says_how_to_use_it_and_makes_no_picture(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        make(script, monkeypatch)
    assert ended.value.code == 2
    assert "required: results" in capsys.readouterr().err
    assert not script.PICTURE.exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "runs.csv: No such file or directory"),
        ("", "no runs of experiments/link_life.yaml"),
        (HEADER, "no runs of experiments/link_life.yaml"),
        ("routing,healed\nthesis,1\n", "no runs of experiments/link_life.yaml: no link_life_s"),
    ],
)
def test_a_folder_without_these_results_is_one_line(
    script: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    content: str | None,
    words: str,
) -> None:
    if content is not None:
        (tmp_path / "runs.csv").write_text(content)
    with pytest.raises(SystemExit, match=words):
        make(script, monkeypatch, tmp_path)
    assert not script.PICTURE.exists()
