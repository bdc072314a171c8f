"""The description of the HTTP side, and the page that shows it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

PAGE = Path(__file__).resolve().parents[3] / "docs" / "raspberry-pi.md"


class Links(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        self.found += [value for name, value in attributes if name in ("href", "src")]


def test_the_page_of_the_operations_needs_nothing_from_elsewhere(mesh):
    page = mesh.client.get("/docs")
    links = Links()
    links.feed(page.text)
    assert len(links.found) >= 2
    for link in links.found:
        assert link.startswith("/")
        assert mesh.client.get(link).status_code == 200
    assert not re.search(r"https?://", page.text)


def test_the_description_names_all_operations_and_what_may_come_back(mesh):
    paths = mesh.client.get("/openapi.json").json()["paths"]
    answers = {
        (method, path): sorted(operation["responses"])
        for path, methods in paths.items()
        for method, operation in methods.items()
    }
    by_the_guard = {"400", "403", "411", "413", "414", "431"}
    always = {"200", "401", "429", "503", "504", *by_the_guard}
    assert answers == {
        ("get", "/ready"): sorted(always),
        ("get", "/nodes"): sorted(always),
        ("get", "/orders"): sorted(always),
        ("get", "/orders/{id}"): sorted(always | {"404", "422"}),
        ("post", "/drones/{id}/goal"): sorted(always | {"409", "422"}),
        ("post", "/DroneMovement/{id}/{latitude}/{longitude}/{height}"): sorted(
            always | {"409", "422"}
        ),
    }


def test_the_page_of_the_pi_lists_each_status_of_a_refusal(mesh):
    text = PAGE.read_text(encoding="utf-8")
    table = text.partition("| status | reason |\n|---|---|\n")[2].partition("\n\n")[0]
    rows = [row.split("|")[1] for row in table.splitlines()]
    listed = {int(status) for row in rows for status in row.split(",")}
    paths = mesh.client.get("/openapi.json").json()["paths"].values()
    operations = [operation for path in paths for operation in path.values()]
    described = {int(status) for operation in operations for status in operation["responses"]}
    assert listed == described - {200} | {405}
