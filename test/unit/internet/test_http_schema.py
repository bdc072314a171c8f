"""The HTTP side against its own OpenAPI description, and the page that shows it."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import ignored_auth, not_a_server_error

from drone_mesh.console.access import Access
from drone_mesh.internet.api import make_api
from drone_mesh.internet.asking import GatewayDesk

schema = schemathesis.openapi.from_dict(
    make_api(GatewayDesk(lambda _function: None, 1.0), Access()).openapi()
)


@schema.parametrize()
@settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_whatever_is_asked_is_answered_as_described(ordered_mesh, case):
    """503 is an answer of a healthy gateway here: most drones that are made up have no route.

    Wrong tokens have a test of their own.
    """
    sent = ordered_mesh.sent()
    answer = case.call(ordered_mesh.internet.url, headers=dict(ordered_mesh.client.headers))
    case.validate_response(answer, excluded_checks=[not_a_server_error, ignored_auth])
    assert answer.status_code not in (500, 504)
    if answer.status_code != 200:
        assert answer.json()["detail"]
        assert ordered_mesh.sent() == sent


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
        ("post", "/DroneMovement/{id}/{latitude}/{longitude}/{height}"): [
            "200",
            "401",
            "422",
            "503",
            "504",
        ],
    }
