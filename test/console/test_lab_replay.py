"""`lab show --console`: a recorded run in the console's page, with a time line. In Chromium."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Iterator

import pytest
from conftest import WAIT_WITHIN_S, Visit
from playwright.sync_api import Browser, Page, expect

from drone_mesh.lab.command import main

ROOT = Path(__file__).resolve().parents[2]
EXPERIMENT = """\
name: replayed
seeds: 1
base:
  layout: {kind: line, drones: 5}
  duration_s: 60
  faults: [{at_s: 20, kill: {ids: [2]}}]
  timing: {connection_lost_after_s: 5}
"""


@pytest.fixture(scope="module")
def replay_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("lab")
    (folder / "replayed.yaml").write_text(EXPERIMENT)
    out = folder / "out"
    assert main(["run", str(folder / "replayed.yaml"), "--out", str(out), "--workers", "0"]) == 0
    run = next(csv.DictReader((out / "runs.csv").open()))["run"]
    process = subprocess.Popen(
        [sys.executable, "-m", "drone_mesh.lab", "show", str(out), run, "--console", "--port", "0"],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert "reproduces the run" in process.stdout.readline()
    said = process.stdout.readline()
    match = re.search(r"http://\S+", said)
    assert match, f"the replay did not start, it said {said!r}"
    yield match[0]
    process.send_signal(signal.SIGINT)
    try:
        assert process.wait(timeout=WAIT_WITHIN_S) == 0
    finally:
        process.kill()


@pytest.fixture
def replay(replay_url: str, browser: Browser) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    visit = Visit(page)
    page.goto(replay_url)
    expect(page.locator("#time-now")).to_contain_text("of 60 s")
    expect(page.locator("#badge")).to_be_visible()
    expect(page.locator("#fly-form, .tools > .live")).to_have_count(4)
    for order in page.locator("#fly-form, .tools > .live, #demonstrate, #power").all():
        expect(order).to_be_hidden()
    yield page
    unexpected = visit.unexpected()
    page.close()
    assert unexpected == []


def shown_s(page: Page) -> float:
    return float(page.locator("#time-now").inner_text().split()[0])


def drag_to(page: Page, share: float) -> None:
    box = page.locator("#timeline input").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 8 + (box["width"] - 16) * share, box["y"] + box["height"] / 2)


def test_the_time_line_has_a_mark_for_the_fault_and_the_flight(replay: Page) -> None:
    expect(replay.locator("#timeline .mark.off")).to_have_count(1)
    assert replay.locator("#timeline .mark.flight").count() >= 1
    assert replay.locator("#timeline .mark.lost").count() >= 1


def test_dragging_shows_the_mesh_as_it_was_at_that_moment(replay: Page) -> None:
    replay.get_by_role("button", name="pause", exact=True).click()
    drag_to(replay, 0.45)  # 27 s: node 2 is dead
    expect(replay.locator("#time-now")).to_contain_text(re.compile(r"^2[67]\.\d"))
    row = replay.locator("#nodes tbody tr").nth(2)
    expect(row).to_contain_text("off")
    expect(replay.locator("#events")).to_contain_text("was switched off")
    drag_to(replay, 0.2)  # 12 s: it lives, and its death is not in the log any more
    expect(replay.locator("#time-now")).to_contain_text(re.compile(r"^1[123]\.\d"))
    expect(row).not_to_contain_text("off")
    expect(replay.locator("#events")).not_to_contain_text("was switched off")


def test_play_pause_and_step(replay: Page) -> None:
    bar = replay.get_by_role("group", name="Playback")
    if bar.get_by_role("button", name="pause").count():
        bar.get_by_role("button", name="pause").click()
    drag_to(replay, 0.5)
    expect(bar.get_by_role("button", name="play")).to_be_visible()
    expect(replay.locator("#time-now")).to_contain_text(re.compile(r"^(29|30|31)\."))
    before_s = shown_s(replay)
    bar.get_by_role("button", name="step", exact=True).click()
    expect(replay.locator("#time-now")).not_to_contain_text(f"{before_s:.1f} of")
    assert 0 < shown_s(replay) - before_s <= 1.0
    bar.get_by_role("button", name="step back").click()
    bar.get_by_role("button", name="play").click()
    expect(replay.locator("#time-now")).to_contain_text(re.compile(r"^3[2-9]\."))
