"""Numbers on command lines."""

from __future__ import annotations

import argparse

import pytest

from drone_mesh.arguments import decimal, whole


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("-3", -3), ("007", 7), ("12", 12)])
def test_whole_numbers_within_the_bounds_are_taken(text, number):
    assert whole(-3, 12)(text) == number


@pytest.mark.parametrize("text", ["", "1_0", "0x10", "1.0", " 1", "+1", "١", "13", "-4", "9" * 30])
def test_anything_else_is_refused_with_the_bounds(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be a whole number -3\.\.12"):
        whole(-3, 12)(text)


@pytest.mark.parametrize(("text", "number"), [("-0.5", -0.5), (".5", 0.5), ("1e1", 10.0)])
def test_decimal_numbers_within_the_bounds_are_taken(text, number):
    assert decimal(-1, 10)(text) == number


@pytest.mark.parametrize("text", ["", "nan", "inf", "1_0", "0x1", "1e2", "--1", "1,5"])
def test_any_other_text_is_refused_with_the_bounds(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be a number -1\.\.10"):
        decimal(-1, 10)(text)
