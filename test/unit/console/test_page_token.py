"""The token of the page, and the line that tells where the page is."""

from __future__ import annotations

from drone_mesh.console.runner import PageToken

TOKEN = "0123456789abcdef"


def test_the_line_does_not_repeat_a_token_that_the_user_gave():
    given = PageToken.needed("0.0.0.0", TOKEN, "/etc/token")
    assert given.access("0.0.0.0").token == TOKEN
    line = given.greeting("10.0.0.1", 8080)
    assert line.startswith("console: http://10.0.0.1:8080/?token=TOKEN, ")
    assert "/etc/token" in line
    assert TOKEN not in line


def test_without_a_token_others_need_a_random_one_which_the_line_contains():
    made = PageToken.needed("::", "", "")
    assert len(made.token) >= 16
    assert made.token != PageToken.needed("::", "", "").token
    assert made.greeting("::1", 80) == f"console: http://[::1]:80/?token={made.token}"


def test_this_machine_alone_needs_none():
    assert PageToken.needed("127.0.0.1", "", "").greeting("127.0.0.1", 1) == (
        "console: http://127.0.0.1:1/"
    )
