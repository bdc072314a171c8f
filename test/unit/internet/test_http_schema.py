"""The HTTP side against its own OpenAPI description."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

from drone_mesh.internet.api import make_api
from drone_mesh.internet.asking import GatewayDesk
from drone_mesh.web.access import Access

pytestmark = pytest.mark.slow  # all: scripts/test leaves the file out of the fast part

schemathesis = pytest.importorskip("schemathesis")
ignored_auth = schemathesis.checks.ignored_auth
negative_data_rejection = schemathesis.checks.negative_data_rejection
not_a_server_error = schemathesis.checks.not_a_server_error

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
    excluded = [not_a_server_error, ignored_auth]
    if answer.status_code == 413:  # also refuses a request, but is not in the library's list
        excluded.append(negative_data_rejection)
    case.validate_response(answer, excluded_checks=excluded)
    assert answer.status_code not in (500, 504)
    if answer.status_code != 200:
        assert answer.json()["detail"]
        assert ordered_mesh.sent() == sent
