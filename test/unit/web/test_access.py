"""Access to the console."""

from __future__ import annotations

import contextlib

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.web.access import (
    FREE_GUESSES,
    MOST_CLIENTS,
    Access,
    AccessDenied,
    Allowance,
    TooManyGuesses,
    access_for,
)

TOKEN = "0123456789abcdef"
HERE = "127.0.0.1"


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "127.0.0.2:1"]
)
def test_without_a_token_the_machine_s_own_names_are_answered(host):
    Access().check_host(host)


@pytest.mark.parametrize(
    "host", ["evil.example:8080", "192.168.1.5:8080", "", "127.0.0.1.evil.example", "[::1", "a@b"]
)
def test_without_a_token_any_other_name_is_refused(host):
    with pytest.raises(AccessDenied, match="is not a loopback name"):
        Access().check_host(host)


def test_with_a_token_any_name_is_accepted():
    Access(TOKEN).check_host("drones.example:8080")


@pytest.mark.parametrize("token", [None, "", "0123456789abcdeX", TOKEN + "0", "größer"])
def test_a_wrong_token_is_refused(token):
    assert not Access(TOKEN).is_right(token, HERE)


def test_the_right_token_is_accepted():
    assert Access(TOKEN).is_right(TOKEN, HERE)
    assert Access().is_right(None, HERE)


def test_an_address_that_guesses_gets_one_guess_a_second_and_others_do_not_wait():
    clock = [1000.0]
    access = Access(TOKEN, guesses=Allowance(FREE_GUESSES, 1.0, lambda: clock[0]))
    for _ in range(FREE_GUESSES):
        assert not access.is_right("wrong", "10.0.0.1")
    with pytest.raises(TooManyGuesses, match=r"from 10\.0\.0\.1: try again"):
        access.is_right(TOKEN, "10.0.0.1")  # the answer would tell that it is the right one
    assert access.is_right(TOKEN, "10.0.0.2")
    compared = 0
    for _ in range(40):
        clock[0] += 0.25
        with contextlib.suppress(TooManyGuesses):
            compared += not access.is_right("wrong", "10.0.0.1")
    assert compared == 10
    clock[0] += 1.0
    assert access.is_right(TOKEN, "10.0.0.1")


def test_a_network_of_ipv6_counts_as_one_address():
    access = Access(TOKEN)
    for number in range(FREE_GUESSES):
        assert not access.is_right("wrong", f"2001:db8::{number:x}")
    with pytest.raises(TooManyGuesses):
        access.is_right("wrong", "2001:db8::ffff")


def test_only_so_many_addresses_are_remembered():
    limit = Allowance(1, 1.0, lambda: 0.0)
    for number in range(2 * MOST_CLIENTS):
        limit.note(f"client {number}")
    assert len(limit._used_up_s) == MOST_CLIENTS


def test_a_missing_token_is_no_guess():
    access = Access(TOKEN)
    assert not any(access.is_right(None, HERE) for _ in range(100))
    assert access.is_right(TOKEN, HERE)


def test_the_own_page_may_connect():
    Access().check_origin("http://127.0.0.1:8080", "127.0.0.1:8080")
    Access().check_origin("https://Drones.example", "drones.example")


@pytest.mark.parametrize(
    "origin",
    [None, "null", "", "http://evil.example", "http://127.0.0.1:9999", "http://127.0.0.1"],
)
def test_another_page_may_not_connect(origin):
    with pytest.raises(AccessDenied, match="was not sent by this server"):
        Access().check_origin(origin, "127.0.0.1:8080")


@pytest.mark.parametrize("address", ["0.0.0.0", "192.168.1.5", "::", "drones.example"])
def test_an_address_that_others_can_reach_needs_a_token(address):
    with pytest.raises(ConfigurationError, match="set a token"):
        access_for(address, "")
    assert access_for(address, TOKEN).token == TOKEN


def test_a_token_that_can_be_guessed_is_refused():
    with pytest.raises(ConfigurationError, match="at least 16 characters"):
        access_for("127.0.0.1", "secret")


def test_this_machine_itself_needs_no_token():
    assert access_for("127.0.0.1", "").token is None


def test_on_a_socket_for_both_protocols_each_ipv4_client_has_guesses_of_its_own():
    access = Access(TOKEN)
    for _ in range(FREE_GUESSES):
        assert not access.is_right("wrong", "::ffff:192.0.2.1")
    with pytest.raises(TooManyGuesses):
        access.is_right(TOKEN, "::ffff:192.0.2.1")
    assert access.is_right(TOKEN, "::ffff:198.51.100.7")
    assert access.is_right(TOKEN, "::1")
    with pytest.raises(TooManyGuesses):
        access.is_right(TOKEN, "192.0.2.1")
