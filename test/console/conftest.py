"""A real browser on a real console over a real mesh; only ROS and the world are left out."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, Request, expect, sync_playwright

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CHROMIUM_FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


class Nursery:
    """Where consoles come from: a process that forks one for each test."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / "console_nursery.py")],
            env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, **order: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()

    def answer(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().rstrip()

    def close(self) -> None:
        with self._process:
            assert self._process.stdin is not None
            self._process.stdin.close()


class ConsoleProcess:
    """A console in a process of its own, which can be stopped and started again on its port."""

    def __init__(self, nursery: Nursery, *arguments: str) -> None:
        self._nursery, self._arguments = nursery, arguments
        self.port = 0
        self._pid: int | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def start(self) -> None:
        self._nursery.ask(start=["--port", str(self.port), *self._arguments])
        self._pid = int(self._nursery.answer())
        said = self._nursery.answer()
        match = re.fullmatch(r"serving on port (\d+)", said)
        assert match, f"the console did not start, it said {said!r}"
        self.port = int(match[1])

    @contextlib.contextmanager
    def stopped(self) -> Iterator[None]:
        """It does nothing meanwhile; its connections stay open."""
        assert self._pid is not None
        os.kill(self._pid, signal.SIGSTOP)
        try:
            yield
        finally:
            os.kill(self._pid, signal.SIGCONT)

    def stop(self) -> int:
        """Ask it to end; returns its exit code."""
        if self._pid is None:
            return 0
        pid, self._pid = self._pid, None
        self._nursery.ask(end=pid)
        code = self._nursery.answer()
        assert code != "null", "the console did not end"
        return int(code)


MOVING = {"reduced_motion": "no-preference"}  # of a visit: packets are drawn, 30 times a second
FIRST_PAUSE_MS, LONGEST_PAUSE_MS = 20.0, 200.0  # between looks, each of which costs milliseconds
WAIT_WITHIN_S = 30.0  # for as long as the page itself waits for the answer to an order
HANGS_AFTER_S = 600  # a test of many waits, each of which may be long on a busy machine
expect.set_options(timeout=1000 * WAIT_WITHIN_S)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        item.add_marker(pytest.mark.timeout(HANGS_AFTER_S))


@pytest.fixture(scope="session")
def nursery() -> Iterator[Nursery]:
    nursery = Nursery()
    yield nursery
    nursery.close()


@contextlib.contextmanager
def consoles(nursery: Nursery) -> Iterator[Callable[..., ConsoleProcess]]:
    """Starts consoles with these arguments of console_process.py, and stops them in the end."""
    started: list[ConsoleProcess] = []

    def start(*arguments: str) -> ConsoleProcess:
        console = ConsoleProcess(nursery, *arguments)
        started.append(console)
        console.start()
        return console

    yield start
    for console in started:
        console.stop()


@pytest.fixture
def start_console(nursery: Nursery) -> Iterator[Callable[..., ConsoleProcess]]:
    with consoles(nursery) as start:
        yield start


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    installed = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    path = os.environ.get("CHROMIUM") or installed
    assert path, "no chromium: apt-get install chromium, or set CHROMIUM to where one is"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()


# The user's reactions to a held order and to the next toast run in the page, because a slow machine
# may take longer than the five seconds for which these are shown.
ANSWER_HELD = """(button) => {
  const held = document.querySelector("#held");
  window.heldText = null;
  new MutationObserver((_changes, observer) => {
    if (held.hidden) return;
    observer.disconnect();
    window.heldText = document.querySelector("#held-text").textContent;
    if (button.length > 1) document.querySelector(button).click();
    else document.body.dispatchEvent(new KeyboardEvent("keydown", { key: button, bubbles: true }));
  }).observe(held, { attributes: true });
}"""
UNDO_TOAST = """() => {
  window.toastTexts = [];
  let undone = false;
  window.toastWatch?.disconnect();
  window.toastWatch = new MutationObserver((changes) => {
    for (const toast of changes.flatMap((change) => [...change.addedNodes])) {
      window.toastTexts.push(toast.querySelector("span").textContent);
      if (!undone && toast.querySelector("button")) {
        undone = true;
        toast.querySelector("button").click();
      }
    }
  });
  window.toastWatch.observe(document.querySelector("#toasts"), { childList: true });
}"""


ABANDONED = "net::ERR_ABORTED"  # by the browser: a reload does not wait for the icon


class Visit:
    """One page, and everything that went wrong on it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self._expected: list[str] = []
        self.requests: list[str] = []
        page.on("console", self._on_console)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("requestfailed", self._on_request_failed)

    def _on_request_failed(self, request: Request) -> None:
        if request.failure != ABANDONED:
            self.complaints.append(f"failed {request.url}: {request.failure}")

    def _on_console(self, message: object) -> None:
        if message.type in ("error", "warning"):  # type: ignore[attr-defined]
            self.complaints.append(message.text)  # type: ignore[attr-defined]

    def expect_complaints(self, *texts: str) -> None:
        """A complaint that contains one of these texts belongs to the test."""
        self._expected += texts

    def unexpected(self) -> list[str]:
        """The complaints so far that do not belong to the test."""
        self.page.wait_for_timeout(0)  # until what has happened has been reported
        return [c for c in self.complaints if not any(text in c for text in self._expected)]

    def drawn(self, what: str) -> int:
        """How many drones, links, links-drawn, route-links or lost-links the map has drawn."""
        return int(self.page.get_attribute("#map-note", f"data-{what}") or -1)

    def row(self, node: int, column: int) -> str:
        """A cell of the table."""
        return self.page.inner_text(f"#nodes tr[data-id='{node}'] td:nth-child({column})")

    def wait_for(
        self, what: str, condition: Callable[[], bool], within_s: float = WAIT_WITHIN_S
    ) -> None:
        deadline_s, pause_ms = time.monotonic() + within_s, FIRST_PAUSE_MS
        while not condition():
            assert time.monotonic() < deadline_s, (
                f"timed out: {what}, waited {within_s:g} s; {self.page.url} shows "
                f"{[self.page.inner_text(part) for part in ('#clock', '#time-now', '#toasts')]}"
            )
            self.page.wait_for_timeout(pause_ms)
            pause_ms = min(1.25 * pause_ms, LONGEST_PAUSE_MS)

    def answer_held(self, button: str) -> None:
        """Click this button, or press this key, as soon as an order is held."""
        self.page.evaluate(ANSWER_HELD, button)

    def wait_for_held(self) -> str:
        """What the order was that was held, in the page's words."""
        self.wait_for("a held order", lambda: self.page.evaluate("window.heldText") is not None)
        return str(self.page.evaluate("window.heldText"))

    def undo_next(self) -> None:
        """Click "Undo" in the next toast that has it."""
        self.page.evaluate(UNDO_TOAST)

    def wait_for_toasts(self, *texts: str) -> None:
        """Wait until exactly these have been shown since `undo_next`."""
        shown: list[str] = []

        def all_shown() -> bool:
            shown[:] = self.page.evaluate("window.toastTexts")
            return shown == list(texts)

        try:
            self.wait_for(f"the toasts {texts}", all_shown)
        except AssertionError as error:
            raise AssertionError(f"{error}\nthese came: {shown}") from error

    def wait_for_drones(self, count: int) -> None:
        self.wait_for(f"{count} drones on the map", lambda: self.drawn("drones") == count)


@contextlib.contextmanager
def visits_of(browser: Browser) -> Iterator[Callable[..., Visit]]:
    """Opens pages: visit(url, **options of the browser's context). None may have complaints.

    The user of a page wishes for little motion, as long as the options are not `MOVING`.
    """
    contexts, visits = [], []

    def open_page(url: str, **options: object) -> Visit:
        options.setdefault("viewport", {"width": 1440, "height": 900})
        options.setdefault("reduced_motion", "reduce")
        context = browser.new_context(**options)  # type: ignore[arg-type]
        contexts.append(context)
        visit = Visit(context.new_page())
        visits.append(visit)
        visit.page.goto(url)
        return visit

    yield open_page
    unexpected = [complaint for visit in visits for complaint in visit.unexpected()]
    for context in contexts:
        context.close()
    assert unexpected == []


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[..., Visit]]:
    with visits_of(browser) as open_page:
        yield open_page


@pytest.fixture(scope="module")
def shared_page(nursery: Nursery, browser: Browser) -> Iterator[Visit]:
    """For tests that order nothing and leave the page as it was: the default fleet, at rest."""
    with consoles(nursery) as start, visits_of(browser) as open_page:
        page = open_page(start("--skip", "25").url)
        page.wait_for_drones(18)
        yield page


def page_of(*arguments: str, **options: object) -> Callable[..., Visit]:
    """A fixture: the page of a console of 18 drones with these arguments, which shows all."""

    @pytest.fixture
    def page(start_console: Callable[..., Any], visit: Callable[..., Visit]) -> Visit:
        opened = visit(start_console(*arguments).url, **options)
        opened.wait_for_drones(18)
        return opened

    return page


page = page_of("--skip", "25")
