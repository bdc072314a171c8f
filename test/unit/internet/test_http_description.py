"""The description of the HTTP side, and the page that shows it."""

from __future__ import annotations

import re
from html.parser import HTMLParser


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
    assert answers == {
        ("get", "/ready"): ["200", "401", "503", "504"],
        ("get", "/nodes"): ["200", "401", "503", "504"],
        ("post", "/drones/{id}/goal"): ["200", "400", "401", "409", "422", "503", "504"],
        ("post", "/DroneMovement/{id}/{latitude}/{longitude}/{height}"): [
            "200",
            "401",
            "422",
            "503",
            "504",
        ],
    }
